from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from deepmuon_runtime import Generator
from deepmuon_runtime.errors import RefusedError
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import FittedGenerator, export_fitted
from deepmuon_training.generators.quantile.fit import QuantileSettings
from deepmuon_training.generators.transformer.fit import TransformerSettings
from deepmuon_training.learning.descent import Schedule
from deepmuon_training.learning.support import Stated
from deepmuon_training.sealed import seal

CHARGE = Schedule(steps=10, learning_rate=0.02, averaging=0.5, validate_every=5)
TINY = {
    "quantile": QuantileSettings(azimuth=CHARGE),
    "transformer": TransformerSettings(
        d=16, batch=512, directions=4, schedule=replace(CHARGE, learning_rate=1e-3), charge=CHARGE, calibration=100_000
    ),
}


@pytest.fixture(scope="module")
def few(sample):
    return replace(sample, muons=sample.muons[:5000])


@pytest.fixture(scope="module")
def fitted(architecture, few) -> FittedGenerator:
    return fit_generator(few, architecture, seed=3, settings=TINY[architecture], progress=False)


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_fit_is_exported_as_a_model_that_gives_muons(fitted, architecture, tmp_path):
    exported = export_fitted(fitted, tmp_path / "model.onnx")
    generator = Generator.open(file=tmp_path / "model.onnx", device="cpu", threads=1)
    assert len(generator.sample(10_000, seed=1)) == 10_000
    assert generator.model.architecture == architecture
    assert generator.model.metadata["training_seed"] == "3"
    assert generator.model.metadata["training_muons"] == "5000"
    assert exported.mismatch.energy < 1e-4
    assert any("ONNX Runtime differs from PyTorch" in note for note in exported.notes)


def test_what_was_saved_and_loaded_is_exported_as_the_same_bytes(fitted, tmp_path):
    fitted.save(tmp_path / "generator.pt")
    loaded = FittedGenerator.load(tmp_path / "generator.pt")
    export_fitted(fitted, tmp_path / "a.onnx")
    export_fitted(loaded, tmp_path / "b.onnx")
    assert digest(tmp_path / "a.onnx") == digest(tmp_path / "b.onnx")
    assert loaded.training == fitted.training
    assert loaded.settings == fitted.settings
    assert loaded.notes == fitted.notes
    assert loaded.unphysical_before_mapping == fitted.unphysical_before_mapping


def test_the_same_fit_is_saved_as_the_same_bytes_under_any_name(fitted, tmp_path):
    for name in ("a.pt", "b.pt"):
        fitted.save(tmp_path / name)
    assert digest(tmp_path / "a.pt") == digest(tmp_path / "b.pt")


def test_a_saved_generator_says_what_training_was(fitted, few, architecture, tmp_path):
    fitted.save(tmp_path / "generator.pt")
    training = FittedGenerator.load(tmp_path / "generator.pt").training
    assert (training.source, training.provenance) == (few.source, few.provenance)
    assert (training.rate, training.depth_m, training.medium) == (few.rate, few.depth_m, few.medium)
    assert (training.muons, training.seed) == (len(few), 3)
    assert fitted.settings[{"quantile": "azimuth", "transformer": "charge"}[architecture]]["steps"] == 10


def test_a_saved_generator_is_replaced_only_if_wanted(fitted, tmp_path):
    path = tmp_path / "generator.pt"
    fitted.save(path)
    with pytest.raises(RefusedError, match="exists already"):
        fitted.save(path)
    fitted.save(path, overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == ["generator.pt"]


class Harmful:
    def __reduce__(self):
        return print, ("executed",)


@pytest.mark.parametrize("content", [b"", b"no generator", b"PK\x03\x04", None, {"format": "other"}, [1], Harmful()])
def test_a_file_that_is_no_generator_is_refused(tmp_path, content, capsys):
    path = tmp_path / "generator.pt"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        path.write_bytes(seal(content))
    with pytest.raises(RefusedError, match="is no generator that deepmuon-train fit wrote"):
        FittedGenerator.load(path)
    assert capsys.readouterr().out == ""


def test_a_generator_of_a_later_version_is_refused(tmp_path):
    (tmp_path / "generator.pt").write_bytes(seal({"format": "deepmuon-generator", "format_version": 4}))
    with pytest.raises(RefusedError, match="has format version 4, and this release reads version 3"):
        FittedGenerator.load(tmp_path / "generator.pt")


def test_an_architecture_that_there_is_not_is_refused(few):
    with pytest.raises(RefusedError, match="there is no architecture diffusion, only quantile and transformer"):
        fit_generator(few, "diffusion", seed=1)


def spoiled(muons, **values):
    columns = {name: getattr(muons, name).copy() for name in values}
    for name, value in values.items():
        columns[name][7] = value
    return replace(muons, **columns)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda m: m[:2999], "2999 muons are too few to learn from"),
        (lambda m: spoiled(m, kinetic_energy=1.1e5), "muon number 7 has a kinetic energy outside 0.001 to 100000 GeV"),
        (lambda m: spoiled(m, kinetic_energy=np.nan), "muon number 7 has a kinetic energy outside"),
        (lambda m: spoiled(m, u=0, v=0, w=1), "muon number 7 does not go down"),
        (lambda m: spoiled(m, u=0, v=0, w=-0.9), "muon number 7 has a direction whose length is not 1"),
    ],
)
def test_a_sample_that_cant_be_learned_is_refused_in_one_line(few, architecture, change, complaint):
    with pytest.raises(RefusedError, match=complaint) as error:
        fit_generator(replace(few, muons=change(few.muons)), architecture, seed=1)
    assert "\n" not in str(error.value)


def test_the_smallest_sample_can_be_learned(sample, architecture, tmp_path):
    smallest = replace(sample, muons=sample.muons[:3000])
    generator = fit_generator(smallest, architecture, seed=1, settings=TINY[architecture], progress=False)
    export_fitted(generator, tmp_path / "model.onnx")


def with_energies(change):
    return lambda m: replace(m, kinetic_energy=change(m.kinetic_energy.astype(float)).astype(np.float32))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            with_energies(lambda e: 0 * e + 4),
            r"100.00% of the muons \(5,000 of 5,000\) have the same .* of 4 GeV",
        ),
        (
            with_energies(lambda e: np.where(e < 2, 1.0, 3.0)),
            "the same kinetic energy of [13] GeV, and 2 energies",
        ),
        (with_energies(lambda e: np.maximum(np.round(e), 1)), "have the same kinetic energy of [123] GeV"),
        (with_energies(lambda e: np.maximum(np.round(e, 1), 0.1)), r"have the same kinetic energy of 0\.\d GeV"),
        (
            with_energies(lambda e: np.maximum(e, np.quantile(e, 0.01))),
            r"1.00% of the muons \(50 of 5,000\) have",
        ),
        (
            with_energies(lambda e: np.minimum(e, np.quantile(e, 0.99))),
            r"1.00% of the muons \(50 of 5,000\) have",
        ),
        (lambda m: m[np.arange(5000) // 10], "90.0% of the 5,000 muons repeat an earlier one, bit by bit"),
        (lambda m: m[:1], "1 muons are too few to learn from"),
        (lambda m: m[:50], "50 muons are too few to learn from"),
    ],
    ids=["one", "two", "whole GeV", "tenths", "clamped below", "clamped above", "repeated", "1 muon", "50 muons"],
)
def test_a_degenerate_sample_is_refused_in_one_line_that_names_it(few, architecture, change, complaint):
    with pytest.raises(RefusedError, match=complaint) as error:
        fit_generator(replace(few, muons=change(few.muons)), architecture, seed=1)
    assert "\n" not in str(error.value)


def vertical(muons):
    zero = np.zeros_like(muons.u)
    return replace(muons, u=zero, v=zero, w=zero - 1)


CUTS = {
    "above 1 GeV": lambda m: m[m.kinetic_energy > 1],
    "below 100 GeV": lambda m: m[m.kinetic_energy < 20],
    "within 60 degrees": lambda m: m[m.cos_zenith > 0.5],
    "mu- alone": lambda m: m[m.charge < 0],
    "mu+ alone": lambda m: m[m.charge > 0],
    "vertical": vertical,
}


@pytest.mark.parametrize("cut", CUTS.values(), ids=CUTS)
def test_no_muon_of_a_generator_is_where_its_truncated_sample_cannot_be(sample, architecture, cut, tmp_path):
    cut_sample = replace(sample, muons=cut(sample.muons[:20_000]))
    fitted = fit_generator(cut_sample, architecture, seed=1, settings=TINY[architecture], progress=False)
    export_fitted(fitted, tmp_path / "model.onnx")
    model, truth = Generator.open(file=tmp_path / "model.onnx", device="cpu", threads=1), cut_sample.muons
    muons = model.sample(300_000, seed=1)
    if truth.kinetic_energy.min() > 0.9:
        assert muons.kinetic_energy.min() >= truth.kinetic_energy.min()
    if truth.kinetic_energy.max() < 21:
        assert muons.kinetic_energy.max() <= truth.kinetic_energy.max()
    assert muons.cos_zenith.min() >= (truth.cos_zenith.min() if truth.cos_zenith.min() >= 0.5 else 0)
    assert set(np.unique(muons.charge)) == set(np.unique(truth.charge))
    assert any(note.startswith("The training sample is of") for note in fitted.notes)


def test_the_support_stands_in_the_metadata(sample, architecture, tmp_path):
    muons = sample.muons[(sample.muons.cos_zenith > 0.5) & (sample.muons.charge < 0)][:10_000]
    fitted = fit_generator(
        replace(sample, muons=muons), architecture, seed=1, settings=TINY[architecture], progress=False
    )
    export_fitted(fitted, tmp_path / "model.onnx")
    metadata = Generator.open(file=tmp_path / "model.onnx", device="cpu").model.metadata
    assert float(metadata["zenith_max_deg"]) == pytest.approx(60, abs=0.05)
    assert metadata["only_charge"] == "-1"


def test_what_is_stated_is_kept_and_muons_beyond_it_are_refused(few):
    top, settings = float(few.muons.kinetic_energy.max()), TINY["quantile"]
    stated = Stated(energy_max=2 * top, zenith_max=89.9)
    fitted = fit_generator(few, "quantile", seed=1, settings=settings, stated=stated, progress=False)
    assert fitted.networks.energy_range[1] == 2 * top
    with pytest.raises(RefusedError, match=r"kinetic energy of .* GeV, outside of the 5 GeV that were stated; so"):
        fit_generator(few, "quantile", seed=1, stated=Stated(energy_max=5))
    with pytest.raises(RefusedError, match=r"has a zenith angle of .* degrees, outside of the 30 degrees"):
        fit_generator(few, "quantile", seed=1, stated=Stated(zenith_max=30))


def turned(muons, strength):
    """Turn muons so that their azimuth phi has the density 1 + strength cos(phi), about."""
    azimuth = np.arctan2(muons.v, muons.u).astype(float)
    azimuth -= strength * np.sin(azimuth)
    sine = np.hypot(muons.u, muons.v)
    return replace(muons, u=(sine * np.cos(azimuth)).astype(np.float32), v=(sine * np.sin(azimuth)).astype(np.float32))


def test_an_azimuth_that_is_not_uniform_is_refused(sample):
    modulated = replace(sample, muons=turned(sample.muons, 0.1))
    with pytest.raises(RefusedError, match=r"the azimuth is not uniform.*--azimuth learned"):
        fit_generator(modulated, "quantile", seed=1)


@pytest.mark.parametrize("d", [-8, 0, 7, 100])
def test_a_width_that_is_no_multiple_of_eight_is_refused(d):
    with pytest.raises(RefusedError, match=f"d is {d}, and should be (a multiple of 8|from 8 to)"):
        TransformerSettings(d=d)


def test_a_batch_smaller_than_one_draw_is_refused():
    with pytest.raises(RefusedError, match="a batch of 512 muons is less than one draw of 1024"):
        TransformerSettings(d=1024, batch=512)


def test_a_quantile_fit_is_the_same_for_any_number_of_threads(few, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    for threads in (1, 2):
        with threadpool_limits(limits=threads):
            fit_generator(few, "quantile", seed=3, progress=False).save(tmp_path / f"{threads}.pt")
    assert digest(tmp_path / "1.pt") == digest(tmp_path / "2.pt")
