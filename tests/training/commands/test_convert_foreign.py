"""Files as other programs write them, through the installed command: what comes out, and what is told."""

from __future__ import annotations

import gzip
import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pytest
import uproot
from support.mcpl_file import mcpl_file
from support.tiny_families import tiny_family
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, Muons, Plane, Sphere, read_attributes, read_muons, write_muons
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_training.fluxes.ecomug import sea_level_muons

SCRIPTS = Path(sysconfig.get_path("scripts"))
MASS = 0.1056583755


@pytest.fixture
def run(tmp_path):
    """Run an installed command: exit code, stdout, stderr."""

    def run(command: str) -> tuple[int, str, str]:
        name, *words = command.split()
        options = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": 300}
        done = subprocess.run([SCRIPTS / name, *words], **options)
        assert done.stderr.count("\n") <= 1
        return done.returncode, done.stdout, done.stderr

    return run


@pytest.fixture
def convert(run, tmp_path):
    """Convert a file that is written first: the muons, and what was told; the result is sound."""

    def convert(content: str | bytes, options: str, name: str = "input") -> tuple[Muons, list[str], str]:
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        code, out, err = run(f"deepmuon-train convert {name} -o muons.h5 {options}")
        assert code == 0, err
        assert check_file(tmp_path / "muons.h5").defects == []
        return read_muons(tmp_path / "muons.h5"), [line.strip() for line in out.splitlines()], err

    return convert


@pytest.fixture
def refuse(run, tmp_path):
    """Convert a file that is written first, which is refused: why."""

    def refuse(content: str | bytes, options: str) -> str:
        (tmp_path / "input").write_bytes(content if isinstance(content, bytes) else content.encode())
        code, out, err = run(f"deepmuon-train convert input -o muons.h5 {options}")
        assert (code, out) == (2, "")
        assert not (tmp_path / "muons.h5").exists()
        return err.removeprefix("deepmuon-train: ").rstrip("\n")

    return refuse


def assert_muons(muons: Muons, energy: list[float], direction: list[list[float]], pdg_id: list[int]) -> None:
    np.testing.assert_allclose(muons.kinetic_energy, energy, rtol=1e-5)
    np.testing.assert_allclose(np.stack([muons.u, muons.v, muons.w], axis=1), direction, atol=1e-5)
    np.testing.assert_array_equal(muons.pdg_id, pdg_id)


def same_columns(one: Muons, other: Muons) -> bool:
    return all(np.allclose(getattr(one, name), getattr(other, name), atol=1e-6) for name in one.columns)


@pytest.mark.parametrize("units", ["GeV", "MeV"])
def test_the_text_of_deepmuon_convert_comes_back_with_all_that_is_known_and_no_option(run, tmp_path, units):
    muons = sea_level_muons(500, seed=1)
    known = {"depth_m": 12.5, "medium": "standard_rock", "source": "the tests", "provenance": ["made", "cut"]}
    known |= {"rate_hz_per_m2": 7.5, "rate_uncertainty_hz_per_m2": 0.25, "smoothed": False}
    known |= {"live_time_s": 3.0, "area_m2": 2.0}
    write_muons(tmp_path / "first.h5", muons, known)
    assert run(f"deepmuon-convert first.h5 muons.csv --units {units}")[0] == 0
    code, out, err = run("deepmuon-train convert muons.csv --format csv -o second.h5")
    assert (code, err) == (0, "")
    assert "rate 7.50 +- 0.25 per m2 and s" in out
    first, second = (read_attributes(tmp_path / f"{name}.h5") for name in ("first", "second"))
    for name in (*known.keys() - {"provenance"}, "live_time_s_m2", "count"):
        assert second[name] == first[name], name
    line = f"muons.csv, columns E [{units}], u, v, w, pdg_id: 500 rows"
    assert second["provenance"] == ["made", "cut", line]
    assert same_columns(read_muons(tmp_path / "second.h5"), muons)


def test_muons_of_a_live_time_on_a_rectangle_are_those_on_its_area(run, tmp_path):
    (tmp_path / "model.onnx").write_bytes(tiny_model())
    Generator.open(file=tmp_path / "model.onnx").write(tmp_path / "muons.csv", target=Plane(2, 4), live_time=3, seed=1)
    assert run("deepmuon-train convert muons.csv --format csv -o muons.h5")[0] == 0
    report = check_file(tmp_path / "muons.h5")
    assert report.defects == []
    known = [report.attributes[name] for name in ("live_time_s", "area_m2", "rate_hz_per_m2")]
    assert known == pytest.approx([3, 8, 55.5])
    lines = (tmp_path / "muons.csv").read_text().splitlines()
    (tmp_path / "part.csv").write_text("\n".join(lines[:-5]) + "\n")
    code, out, err = run("deepmuon-train convert part.csv --format csv -o part.h5")
    assert (code, "their rate is left out" in err) == (0, True)
    assert out.splitlines()[0].endswith("rate unknown")


def test_muons_that_hit_a_body_are_none_of_a_plane(run, tmp_path):
    (tmp_path / "family.onnx").write_bytes(tiny_family())
    Generator.open(file=tmp_path / "family.onnx").write(tmp_path / "muons.csv", 10, target=Sphere(0.1))
    code, _, err = run("deepmuon-train convert muons.csv --format csv -o muons.h5")
    assert code == 2
    assert err.startswith(
        "deepmuon-train: muons.csv has muons that hit a sphere, and a sample's cross a horizontal plane"
    )


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("--units GeV", "input calls a column 'kinetic_energy_MeV', and --units says GeV: leave it out"),
        ("--columns E,v,u,w,pdg_id", "input calls column 2 'u', and --columns says v"),
        ("--columns p,u,v,w,pdg_id", "input calls column 1 'kinetic_energy_MeV', and --columns says p"),
        ("--depth 20", "input says depth_m = 10.0, and --depth 20.0: leave it out"),
        ("--rate 5", "input says rate_hz_per_m2 = 50.0, and --rate 5.0: leave it out"),
        ("--live-time 5 --area 1", "input says rate_hz_per_m2 = 50.0: leave --live-time out"),
    ],
)
def test_what_contradicts_the_file_is_refused(run, refuse, tmp_path, options, reason):
    known = {"depth_m": 10.0, "medium": "G4_WATER", "source": "x", "provenance": [], "rate_hz_per_m2": 50.0}
    write_muons(tmp_path / "first.h5", sea_level_muons(5, seed=1), known)
    assert run("deepmuon-convert first.h5 muons.csv --units MeV")[0] == 0
    assert refuse((tmp_path / "muons.csv").read_bytes(), f"--format csv {options}") == reason


def test_of_a_part_of_the_muons_the_rate_is_not_that_of_all(run, convert, tmp_path):
    known = {"depth_m": 10.0, "medium": "G4_WATER", "source": "x", "provenance": [], "rate_hz_per_m2": 50.0}
    write_muons(tmp_path / "first.h5", sea_level_muons(5, seed=1), known)
    text = run("deepmuon-convert first.h5 -")[1]
    _, out, err = convert("\n".join(text.splitlines()[:-2]), "--format csv")
    assert out[0].endswith("rate unknown")
    assert err.startswith("deepmuon-train: warning: input has 3 muons, and its comments speak of 5: their rate is left")
    assert convert(text.rsplit("\n", 3)[0], "--format csv --rate 5 --overwrite")[1][0].endswith(
        "rate 5.00 per m2 and s"
    )


TEXTS = {
    "Fortran's exponents": "2.0D+00 1.0D-01 -0.3D0\n 5.D-1  0.0d0  0.5\n",
    "quotes": '"2.0","0.1","-0.3"\n"0.5","0","0.5"\n',
    "semicolons": "2.0;0.1;-0.3\n0.5;0;0.5\n",
    "tabs": "2.0\t0.1\t-0.3\n0.5\t0\t0.5\n",
    "comments and blank lines": "# made\n\n# by hand\n2 0.1 -0.3\n\n# more\n  \n0.5 0 0.5\n\n",
    "a heading": "energy,u,v\n2,0.1,-0.3\n.5,0,.5",
    "a mark and a carriage return": "\ufeff2,0.1,-0.3\r\n.5,0,.5\r\n",
    "UTF-16": "E u v\n2 0.1 -0.3\n.5 0 .5\n".encode("utf-16"),
    "gzip": gzip.compress(b"2 0.1 -0.3\n.5 0 .5\n"),
}


@pytest.mark.parametrize("kind", TEXTS)
def test_text_of_every_common_kind_is_read(convert, kind):
    muons, out, _ = convert(TEXTS[kind], "--format csv --columns E,u,v --units GeV --charge +1")
    assert_muons(muons, [2, 0.5], [[0.1, -0.3, -(0.9**0.5)], [0, 0.5, -(0.75**0.5)]], [-13, -13])
    assert out[1] == "input, columns E [GeV], u, v: 2 rows"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("NA,NA,NA\n2,0.1,-0.3\n", "input, line 1: 'NA,NA,NA' is no row of 3 columns: 'NA' is no number"),
        ("muons of May\n2,0.1\n", "input, line 2: '2,0.1' is no row of 3 columns: it has 1"),
        ("words\n", "input, line 1: 'words' is no row of 3 columns: it has 1"),
        ("my muons\n2,0.1,-0.3\n", "input, line 1: 'my muons' is no heading of 3 columns: a comment begins with #"),
        ("E,u,v\nMeV,1,1\n", "input, line 2: 'MeV,1,1' is no row of 3 columns: 'MeV' is no number"),
        (
            "2,0;0,1;-0,3\n",
            "input, line 1: '2,0;0,1;-0,3' is no row of 3 columns: it looks like decimal commas, write decimal points",
        ),
        (b"PAR1....", "input is no text: it is a Parquet file: write it as text first"),
    ],
)
def test_text_that_is_none_is_refused_by_its_line(refuse, text, reason):
    assert refuse(text, "--format csv --columns E,u,v --units GeV --charge +1") == reason


def test_momenta_of_corsika_point_down_and_other_particles_are_counted(convert, refuse):
    text = "# id px py pz weight\n5 0.6 0 0.8 1\n1 9 9 9 1\n6 -3.0 0 4.0 1\n2 1 0 -1 1\n2 1 0 1 1\n"
    options = "--format csv --columns corsika_id,px,py,-pz,skip --units GeV"
    assert refuse(text, options) == (
        "input, line 3: corsika_id 1 is no muon (mu- is 6, mu+ 5): --muons-only leaves other particles out"
    )
    muons, out, _ = convert(text, f"{options} --muons-only")
    energy = [np.hypot(1, MASS) - MASS, np.hypot(5, MASS) - MASS]
    assert_muons(muons, energy, [[0.6, 0, -0.8], [-0.6, 0, -0.8]], [-13, 13])
    assert out[2] == "3 of 5 rows left out, which are no muons: 2 of 2, 1 of 1"


def test_muons_of_musun_come_from_an_angle(convert):
    text = "1 10 280.5 0 0 0 30 90\n2 11 12.25 0 0 0 60 0\n"
    columns = "skip,musun_id,Etot,skip,skip,skip,zenith,azimuth"
    muons, _, _ = convert(text, f"--format csv --columns {columns} --units GeV --angles deg --depth 1480 --medium G4_X")
    assert_muons(muons, [280.5 - MASS, 12.25 - MASS], [[0, -0.5, -(0.75**0.5)], [-(0.75**0.5), 0, -0.5]], [-13, 13])


@pytest.mark.parametrize(("name", "minus", "plus"), [("pdg_id", "1.3000D+01", "-1.3000D+01"), ("phits_id", "7", "6")])
def test_a_dump_of_phits_is_read(convert, name, minus, plus):
    end = "1.0000D+00 0.0000D+00"
    text = f"{minus} 0 0 0 6.0D-01 0.0D+00 -8.0D-01 2.1500D+03 {end}\n{plus} 0 0 0 0 0 -1 8.0D+02 {end}\n"
    muons, out, _ = convert(text, f"--format csv --columns {name},skip,skip,skip,u,v,w,E,weight,skip --units MeV")
    assert_muons(muons, [2.15, 0.8], [[0.6, 0, -0.8], [0, 0, -1]], [13, -13])
    assert out[2] == "the weights are all the same"


def test_headings_name_units_and_text_is_skipped(convert, refuse):
    text = "name;Ekin [TeV];theta (rad);phi (rad);note\nmu-;0.5;3.141592653589793;0;from above, alone\n"
    assert refuse(text, "--format csv --charge -1") == (
        "input: the column 'theta (rad)' can be theta or zenith: say which by --columns"
    )
    muons, out, _ = convert(text, "--format csv --columns skip,E,theta,phi,skip --charge -1")
    assert_muons(muons, [500], [[0, 0, -1]], [13])
    assert out[1] == "input, columns skip, E [TeV], theta [rad], phi [rad], skip: 1 row"


def test_a_table_of_pandas_with_its_row_numbers_is_read(convert):
    muons, out, _ = convert(",Ekin_GeV,u,v,w,charge\n0,2.5,0.6,0,-0.8,-1\n1,0.5,0,0,-1,1\n", "--format csv")
    assert_muons(muons, [2.5, 0.5], [[0.6, 0, -0.8], [0, 0, -1]], [13, -13])
    assert out[1] == "input, columns skip, E [GeV], u, v, w, charge: 2 rows"


def test_columns_that_nobody_names_are_asked_for(refuse):
    assert refuse("4000,.1,.2\n", "--format csv --charge -1") == (
        "input has no heading that names its 3 columns (it begins with '4000,.1,.2'): give --columns"
    )


def test_columns_are_named_by_their_headings(convert):
    text = "event,KE_MeV,x,dir_z,dir_x,dir_y,who\n1,2150,0,0.8,0.6,0,mu-\n"
    muons, _, _ = convert(text, "--format csv --columns u=dir_x,v=dir_y,-w=dir_z,E=KE_MeV --charge -1")
    assert_muons(muons, [2.15], [[0.6, 0, -0.8]], [13])


def weighted(n: int) -> str:
    energy = np.random.default_rng(1).uniform(1, 2, n)
    return "E_kin_GeV,u,v,weight\n" + "".join(f"{e:.6f},0,0,{10 * (e - 1):.6f}\n" for e in energy)


def test_weighted_muons_become_muons_that_weigh_the_same(convert):
    muons, out, _ = convert(weighted(20_000), "--format csv --charge -1 --seed 5")
    told = f"unweighted by accept-reject, seed 5: {len(muons):,} of 20,000 muons kept, effective size 1"
    assert out[2].startswith(told)
    above = np.sum(muons.kinetic_energy > 1.5)  # false alarm: 1e-4
    assert abs(above - 0.75 * len(muons)) < 3.9 * np.sqrt(len(muons) * 0.75 * 0.25)


def test_too_few_weighted_muons_are_refused(refuse):
    reason = refuse(weighted(80), "--format csv --charge -1")
    assert reason.startswith("80 muons of these weights are worth ")
    assert reason.endswith(" of one weight, and 100 are the fewest")


def test_energies_in_the_wrong_unit_are_warned_of(convert):
    text = "u,v,ke\n" + "0,0.1,4\n" * 50 + "0,0,0.5\n" * 50
    _, out, err = convert(text, "--format csv --units MeV --charge -1")
    assert out[2] == "50 of 100 muons below 1 MeV dropped"
    assert err.startswith("deepmuon-train: warning: 50 of 100 muons are below 1 MeV, and dropped")
    assert err.endswith(": are the energies in GeV, and not in MeV?\n")
    large = text.replace(",4", ",4000").replace(",0.5", ",1500")
    _, _, err = convert(large, "--format csv --units GeV --charge -1 --overwrite")
    assert err == (
        "deepmuon-train: warning: half of the muons have more than 1 TeV: are the energies in MeV, and not in GeV?\n"
    )


@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_mcpl_is_read(convert, pack):
    pytest.importorskip("mcpl")
    direction = [[0.6, 0, -0.8], [0, 0, 1], [0, -0.28, -0.96]]
    content = pack(mcpl_file([13, 22, -13], [2150.0, 5.0, 830.0], direction, [1.0, 1.0, 1.0]))
    name = "muons.mcpl" if pack is bytes else "muons.mcpl.gz"
    muons, out, _ = convert(content, "--format mcpl --muons-only", name)
    assert_muons(muons, [2.15, 0.83], [direction[0], direction[2]], [13, -13])
    assert out[1:3] == [
        f"{name}, columns pdg_id, E [MeV], u, v, w, weight: 3 rows",
        "1 of 3 rows left out, which are no muons: 1 of 22",
    ]


def test_mcpl_is_refused_where_it_is_none_or_cut(run, tmp_path):
    pytest.importorskip("mcpl")
    whole = mcpl_file([13], [2150.0], [[0.6, 0, -0.8]], [1.0])
    for content, reason in (
        (b"1 2 3", "muons.mcpl can't be read as an MCPL file: "),
        (whole[:-8], "muons.mcpl can't be read after particle 0: "),
        (mcpl_file([11], [5.0], [[0, 0, -1]], [1.0]), "muons.mcpl, particle 0: pdg_id 11 is no muon"),
        (mcpl_file([13], [5.0], [[0, 0, 1]], [1.0]), "muons.mcpl, particle 0: the muon does not go down"),
    ):
        (tmp_path / "muons.mcpl").write_bytes(content)
        code, _, err = run("deepmuon-train convert muons.mcpl --format mcpl -o muons.h5")
        assert code == 2
        assert err.startswith(f"deepmuon-train: {reason}")


COLUMNS = {"Ekin_GeV": [2.15, 0.83], "dirX": [0.6, 0.0], "dirY": [0.0, -0.28], "dirZ": [-0.8, -0.96]}


@pytest.fixture(params=["mktree", "mkrntuple"])
def root_file(request, tmp_path):
    """A ROOT file with two trees, as TTree and as RNTuple."""
    columns = {name: np.array(values) for name, values in COLUMNS.items()}
    columns |= {"pdg": np.array([13, -13], np.int32), "hits": np.ones((2, 3), np.float32)}
    with uproot.recreate(tmp_path / "muons.root") as file:
        for name in ("muons", "others"):
            tree = getattr(file, request.param)(name, {key: _type(value) for key, value in columns.items()})
            tree.extend(columns)
    return tmp_path / "muons.root"


def _type(column: np.ndarray):
    return column.dtype if column.ndim == 1 else np.dtype((column.dtype, column.shape[1:]))


def test_a_tree_of_root_is_read(run, tmp_path, root_file):
    code, out, err = run("deepmuon-train convert muons.root:muons --format root --depth 10 -o muons.h5")
    assert (code, err) == (0, "")
    direction = [[0.6, 0, -0.8], [0, -0.28, -0.96]]
    assert_muons(read_muons(tmp_path / "muons.h5"), [2.15, 0.83], direction, [13, -13])
    assert "muons.root:muons, columns E [GeV], u, v, w, pdg_id: 2 rows" in out
    named = "E=Ekin_GeV,u=dirX,v=dirY --charge -1"
    assert run(f"deepmuon-train convert muons.root:others --format root --columns {named} -o named.h5")[0] == 0
    assert_muons(read_muons(tmp_path / "named.h5"), [2.15, 0.83], direction, [13, 13])


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("muons.root -o x.h5", "muons.root has the trees muons, others: name one, as in muons.root:muons"),
        ("muons.root:none -o x.h5", "muons.root:none: there is no tree none, but muons, others"),
        ("muons.root:muons --units MeV -o x.h5", "muons.root:muons calls a column 'Ekin_GeV', and --units says MeV"),
        (
            "muons.root:muons --columns E=e,u=dirX -o x.h5",
            "muons.root:muons has no column 'e' for E, but Ekin_GeV, dirX",
        ),
        ("muons.root:muons -o muons.root --overwrite", "muons.root is read here, and would be replaced"),
    ],
)
def test_a_tree_that_is_not_said_or_contradicted_is_refused(run, root_file, words, reason):
    before = root_file.read_bytes()
    code, out, err = run(f"deepmuon-train convert {words} --format root")
    assert (code, out) == (2, "")
    assert err.startswith(f"deepmuon-train: {reason}")
    assert root_file.read_bytes() == before
