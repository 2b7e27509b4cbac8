from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from scipy.stats import chi2

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.philox import latents
from deepmuon_training.release.first_models import convert, from_first

OLD = Path(__file__).parents[2] / "models" / "deepmuon_models" / "quantile-10m.onnx"
TRANSFORMER = OLD.with_stem("transformer-10m")
OUTPUTS = ["kinetic_energy", "direction", "charge"]


@pytest.fixture(scope="module")
def new(tmp_path_factory) -> Path:
    try:
        from_first(OLD.read_bytes())
    except RefusedError:
        pytest.skip("the released models are converted already")
    path = tmp_path_factory.mktemp("converted") / "new.onnx"
    convert(OLD, path)
    return path


def muons(model: Path, latent: np.ndarray) -> list[np.ndarray]:
    return onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"]).run(OUTPUTS, {"latent": latent})


def test_energies_stay_muon_by_muon(new):
    latent = latents(seed=1, first=0, draws=100_000, latent_size=5)
    energy = muons(OLD, latent)[0]
    np.testing.assert_allclose(muons(new, latent)[0], energy, rtol=2e-4)


def histograms(muons: list[np.ndarray]) -> dict[str, np.ndarray]:
    energy, direction, charge = muons
    log_energy, cos_zenith, plus = np.log10(energy), -direction[:, 2].astype(float), charge > 0
    plane = (30, 30), ((-2, 4), (0, 1))
    return {
        "energy": np.histogram(log_energy, 1000, (-3, 5))[0],
        "zenith": np.histogram(cos_zenith, 1000, (0, 1))[0],
        "vertical": np.histogram(np.hypot(*direction[:, :2].T), 100, (0, 0.1))[0],
        "horizon": np.histogram(cos_zenith, 40, (0, 0.2))[0],
        "azimuth": np.histogram(np.arctan2(direction[:, 1], direction[:, 0]), 500, (-np.pi, np.pi))[0],
        "both": np.histogram2d(log_energy, cos_zenith, *plane)[0].ravel(),
        "mu+": np.histogram2d(log_energy[plus], cos_zenith[plus], *plane)[0].ravel(),
    }


def test_the_muons_have_the_distribution_of_the_old_models(new):
    n = 1_000_000
    old = histograms(muons(OLD, latents(seed=2, first=0, draws=n, latent_size=5)))
    for name, found in histograms(muons(new, latents(seed=3, first=0, draws=n, latent_size=5))).items():
        both = (found + old[name]).astype(float)
        enough = both > 20
        chi_square = np.sum((found - old[name])[enough] ** 2 / both[enough])
        assert chi2.sf(chi_square, enough.sum()) > 1e-4, name  # seven of them: a false alarm in 1400 seeds


def test_a_file_of_this_release_is_refused(new):
    with pytest.raises(RefusedError, match="no quantile model of release"):
        from_first(new.read_bytes())


def test_a_transformer_gives_the_same_muons_bit_by_bit(tmp_path):
    convert(TRANSFORMER, tmp_path / "new.onnx")
    latent = latents(seed=1, first=0, draws=100, latent_size=356)
    for found, expected in zip(muons(tmp_path / "new.onnx", latent), muons(TRANSFORMER, latent), strict=True):
        np.testing.assert_array_equal(found, expected)
