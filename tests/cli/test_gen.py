from __future__ import annotations

import hashlib
import os
import pty
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.commands import with_models
from support.tiny_models import RARELY_BAD, tiny_model

from deepmuon_cli.gen import main
from deepmuon_cli.process.signals import SIGNALS
from deepmuon_runtime import Generator, Muons, RefusedError, read_attributes, read_muons

COMMAND = [sys.executable, "-m", "deepmuon_cli.gen"]


@pytest.fixture
def gen(tmp_path, monkeypatch, capsys):
    """Run the command in this process, in a folder of its own: exit code, stdout, stderr."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    handlers = {number: signal.getsignal(number) for number in SIGNALS}

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["/bin/deepmuon-gen", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, *capsys.readouterr()

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


def files() -> list[str]:
    return sorted(os.listdir())


@pytest.mark.usefixtures("released")
def test_the_main_job_gives_the_muons_of_the_model_and_says_so(gen):
    code, out, err = gen("--depth", "10", "-n", "1_000", "-o", "muons.h5", "--seed", 7)
    assert (code, err) == (0, "")
    assert re.fullmatch(
        r"muons\.h5: 1,000 muons in \d+\.\d\d s, [\d,]+ muons/s on cpu, "
        r"equivalent live time 18\.0 s for 1 m2 at 55\.5 a second, seed 7\n",
        out,
    )
    assert files() == ["muons.h5"]
    expected = Generator.open(10).sample(1000, seed=7)
    assert np.array_equal(read_muons("muons.h5").kinetic_energy, expected.kinetic_energy)
    attributes = read_attributes("muons.h5")
    assert attributes["command_line"] == "deepmuon-gen --depth 10.0 --number 1000 --seed 7"
    assert attributes["live_time_s_m2"] == 1000 / 55.5


@pytest.mark.usefixtures("released")
def test_two_depths_of_a_seed_have_nothing_in_common(gen):
    """The two models have the same graph; the correlation is within 4 standard deviations: 6e-5 false alarms."""
    n = 20_000
    for depth in (0, 10):
        assert gen("--depth", depth, "-n", n, "--seed", 1, "-o", f"{depth}.h5")[0] == 0
    energies = [np.log(read_muons(f"{depth}.h5").kinetic_energy) for depth in (0, 10)]
    assert abs(np.corrcoef(energies)[0, 1]) < 4 / np.sqrt(n)


def test_no_name_of_a_file_is_recorded(gen, model_file):
    """It could hold a secret, and the model is known by its hash."""
    secret = model_file.rename(model_file.with_name("secret.onnx"))
    assert gen("--model", secret, "-n", 10, "--threads", 1, "-q", "-o", "secret.h5") == (0, "", "")
    assert read_attributes("secret.h5")["command_line"] == "deepmuon-gen --number 10 --threads 1"
    with open("secret.h5", "rb") as file:
        assert b"secret" not in file.read()


@pytest.mark.parametrize(
    ("output", "reason"),
    [
        (
            "-",
            "- is no name of a muon file, which can't go to stdout: give one, as in -o muons.h5, and then",
        ),
        ("/dev/stdout", "/dev/stdout is a device or a pipe: give the name of a regular file"),
        (
            "muons.txt",
            "muons.txt would be HDF5 under a name of text: write muons.h5, and then",
        ),
        ("muons.parquet", "muons.parquet would be HDF5 under a name of Parquet"),
        (
            "muons.h5.gz",
            "muons.h5.gz would be HDF5 under a name of a packed file: write muons.h5, and then deepmuon-convert "
            "muons.h5 muons.csv.gz",
        ),
    ],
)
def test_an_output_that_promises_what_is_not_written_is_refused(tmp_path, model_file, output, reason):
    """With stdout a pipe."""
    words = [*COMMAND, "--model", str(model_file), "-n", "10", "-o", output]
    before = set(tmp_path.iterdir())
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert reason in done.stderr
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("name", ["h5", "csv", "mcpl"])
def test_no_format_goes_to_stdout(tmp_path, model_file, name):
    words = [*COMMAND, "--model", str(model_file), "-n", "10", "--format", name, "-o", "-"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "which can't go to stdout" in done.stderr
    assert not (tmp_path / "-").exists()


def test_a_model_of_ones_own_is_taken_from_its_file(gen, model_file):
    assert gen("--model", model_file, "-n", 10, "-o", "muons.h5")[0] == 0
    assert len(read_muons("muons.h5")) == 10


@pytest.mark.usefixtures("released")
def test_an_architecture_can_be_chosen(gen):
    code, *_ = gen("--depth", 10, "--architecture", "transformer", "-n", 10, "-o", "muons.h5")
    assert code == 0
    assert read_attributes("muons.h5")["architecture"] == "transformer"


@pytest.mark.parametrize(
    ("text", "n"), [("10", 10), ("1e3", 1000), ("1_000", 1000), ("2.5e1", 25), ("1E2", 100), ("+7", 7)]
)
def test_numbers_are_exact_however_they_are_written(gen, model_file, text, n):
    assert gen("--model", model_file, f"-n{text}", "-o", "muons.h5")[0] == 0
    assert read_attributes("muons.h5")["count"] == n


def test_a_seed_that_is_left_out_is_new_and_reported(gen, model_file):
    seeds = []
    for name in ("a.h5", "b.h5"):
        _, out, _ = gen("--model", model_file, "-n", 10, "-o", name)
        seeds.append(read_attributes(name)["seed"])
        assert out.endswith(f"seed {seeds[-1]}\n")
    assert seeds[0] != seeds[1]


def test_the_largest_seed_is_a_seed(gen, model_file):
    assert gen("--model", model_file, "-n", 1, "-o", "a.h5", "--seed", 2**64 - 1)[0] == 0
    assert read_attributes("a.h5")["seed"] == 2**64 - 1


def test_threads_change_nothing(gen, model_file):
    for threads in (1, 3):
        name = f"{threads}.h5"
        assert gen("--model", model_file, "-n", "2e5", "-o", name, "--seed", 1, "--threads", threads)[0] == 0
    for column in ("kinetic_energy", "u", "v", "w", "pdg_id"):
        assert np.array_equal(getattr(read_muons("1.h5"), column), getattr(read_muons("3.h5"), column))


@pytest.mark.parametrize("amount", [("-n", "1e5"), ("--live-time", 1e3, "--area", 1)], ids=["number", "live time"])
def test_shards_are_the_single_run(gen, model_file, amount):
    arguments = ("--model", model_file, *amount, "--seed", 3)
    assert gen(*arguments, "-o", "all.h5")[0] == 0
    joined = []
    for i in (1, 2, 3):
        code, out, _ = gen(*arguments, "--shard", f"{i}/3", "-o", f"{i}.h5")
        joined.append(read_muons(f"{i}.h5"))
        assert code == 0
        assert out.startswith(f"{i}.h5: {len(joined[-1]):,} muons in ")
        assert read_attributes(f"{i}.h5")["shard"] == f"{i}/3"
        assert (f"shard {i}/3 of a live time 1,000 s on 1 m2 at 55.5 a second" in out) == ("--live-time" in amount)
    for column in ("kinetic_energy", "u", "v", "w", "pdg_id"):
        assert np.array_equal(getattr(Muons.concatenate(joined), column), getattr(read_muons("all.h5"), column))


def test_a_live_time_gives_a_poisson_number_at_the_models_rate(gen, model_file):
    """At 5 standard deviations of the sum of 20 numbers: 1e-6 false alarms."""
    counts = []
    for seed in range(20):
        arguments = ("--live-time", "1e2", "--area", "0.5", "-o", f"{seed}.h5", "--seed", seed)
        code, out, _ = gen("--model", model_file, *arguments)
        assert code == 0
        assert "live time 100 s on 0.5 m2 at 27.75 a second" in out
        attributes = read_attributes(f"{seed}.h5")
        assert attributes["count"] == attributes["total"] == len(read_muons(f"{seed}.h5"))
        assert (attributes["live_time_s"], attributes["area_m2"]) == (100, 0.5)
        counts.append(attributes["count"])
    assert len(set(counts)) > 5
    assert abs(sum(counts) - 20 * 55.5 * 50) < 5 * np.sqrt(20 * 55.5 * 50)


def test_a_short_live_time_may_give_no_muon(gen, model_file):
    assert gen("--model", model_file, "--live-time", 1e-9, "--area", 1, "-o", "none.h5")[0] == 0
    assert len(read_muons("none.h5")) == 0


def test_quiet_says_nothing(gen, model_file):
    assert gen("--model", model_file, "-n", 10, "-o", "muons.h5", "--quiet") == (0, "", "")


def test_an_existing_output_is_replaced_only_where_asked(gen, model_file):
    arguments = ("--model", model_file, "-o", "muons.h5")
    assert gen(*arguments, "-n", 10)[0] == 0
    code, _, err = gen(*arguments, "-n", 20)
    assert code == 2
    assert "exists already" in err
    assert "--overwrite" in err
    assert len(read_muons("muons.h5")) == 10
    assert gen(*arguments, "-n", 20, "--overwrite")[0] == 0
    assert len(read_muons("muons.h5")) == 20
    assert files() == ["muons.h5"]


@pytest.mark.usefixtures("released")
def test_the_list_shows_every_model_and_the_default(gen):
    code, out, err = gen("--list")
    assert (code, err) == (0, "")
    rows = [line.split() for line in out.splitlines()]
    assert [row[:5] for row in rows[1:-1]] == [
        ["quantile*", "cry", "water", "0", "110.00"],
        ["quantile*", "cry", "water", "10", "55.50"],
        ["transformer", "cry", "water", "10", "55.50"],
    ]


@pytest.mark.usefixtures("released_families")
def test_the_list_shows_what_there_is_to_choose_and_marks_what_is_taken(gen):
    code, out, _ = gen("--list")
    assert code == 0
    lines = out.splitlines()
    assert max(map(len, lines)) <= 100
    assert [re.split("  +", line)[:6] for line in lines[:-2]] == [
        ["architecture", "flux", "medium", "depth/m", "rate/(1/m2/s)", "trained on"],
        ["quantile*", "cry", "water", "0 to 100", "of the depth", "68,000,000"],
        ["quantile", "cry", "water", "0", "110.00", "unknown"],
        ["quantile", "cry", "water", "10", "55.50", "unknown"],
        ["quantile", "measured", "water", "0 to 5000", "of the depth", "68,000,000"],
        ["quantile", "measured", "rock", "0 to 2500", "of the depth", "68,000,000"],
        ["transformer", "cry", "water", "10", "55.50", "unknown"],
    ]
    assert lines[-2] == "* taken where nothing but a depth is named"
    assert lines[-1].startswith("A family serves each depth of its range")


@pytest.mark.usefixtures("released_families")
def test_flux_and_medium_are_chosen_and_recorded(gen):
    model = ("--flux", "measured", "--medium", "rock", "--depth", 1000)
    assert gen(*model, "--live-time", 86400, "--area", 0.01, "--seed", 1, "-o", "muons.h5")[::2] == (0, "")
    attributes = read_attributes("muons.h5")
    assert (attributes["flux"], attributes["medium"], attributes["depth_m"]) == ("measured", "rock", 1000)
    assert attributes["rate_hz_per_m2"] == 30
    assert attributes["command_line"] == (
        "deepmuon-gen --depth 1000.0 --flux measured --medium rock --live-time 86400.0 --area 0.01 --seed 1"
    )
    generator = Generator.open(1000, flux="measured", medium="rock")
    expected = generator.sample(live_time=86400, area=0.01, seed=1)
    assert np.array_equal(read_muons("muons.h5").kinetic_energy, expected.kinetic_energy)


@pytest.mark.usefixtures("released_families")
def test_a_file_says_the_default_flux_too(gen):
    assert gen("--depth", 10, "-n", 10, "-o", "muons.h5")[0] == 0
    attributes = read_attributes("muons.h5")
    assert (attributes["flux"], attributes["medium"]) == ("cry", "water")


def test_a_model_that_does_not_say_its_flux_leaves_it_open(gen, model_file):
    assert gen("--model", model_file, "-n", 10, "-o", "muons.h5")[0] == 0
    assert "flux" not in read_attributes("muons.h5")


@pytest.mark.usefixtures("released_families")
def test_any_depth_of_a_released_family_is_generated_and_recorded(gen):
    code, out, err = gen("--depth", "13.7", "-n", "1000", "-o", "muons.h5", "--seed", 7)
    assert (code, err) == (0, "")
    assert f"equivalent live time {1000 / 82.6:.1f} s" in out
    assert read_attributes("muons.h5")["depth_m"] == 13.7
    assert read_attributes("muons.h5")["rate_hz_per_m2"] == 82.6
    assert np.array_equal(
        read_muons("muons.h5").kinetic_energy, Generator.open(13.7).sample(1000, seed=7).kinetic_energy
    )


@pytest.mark.usefixtures("released_families")
@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            "--depth 100.5",
            "no quantile model of flux cry for a depth of 100.5 m of water: cry in water has 0 to 100 m; measured in "
            "water has 0 to 5000 m; measured in rock has 0 to 2500 m",
        ),
        (
            "--depth 10 --medium rock",
            "no released model of flux cry in rock: there are cry in water, measured in water and measured in rock",
        ),
        (
            "--depth 10 --flux ecomug",
            "no released model of flux ecomug in water: there are cry in water, measured in water and measured in rock",
        ),
        (
            "--depth 10 --flux measured --architecture transformer",
            "no released transformer of flux measured in water: there is cry in water",
        ),
    ],
)
def test_a_depth_a_flux_or_a_medium_that_is_lacking_is_refused_with_what_there_is(gen, words, reason):
    assert gen(*words.split(), "-n", "1000", "-o", "muons.h5") == (2, "", f"deepmuon-gen: {reason}\n")
    assert files() == []


def test_a_model_of_one_depth_takes_none(gen, model_file):
    code, out, err = gen("--model", model_file, "--depth", "10", "-n", "10", "-o", "muons.h5")
    assert (code, out, files()) == (2, "", [])
    assert err == f"deepmuon-gen: {model_file} is no family: all its muons are of 10 m; give no depth with it\n"


def test_a_family_of_ones_own_takes_a_depth(gen, family_file):
    for name, options in (("muons.h5", ["--depth", "13.7"]), ("default.h5", [])):
        code, _, err = gen("--model", family_file, *options, "-n", "1000", "-o", name)
        assert (code, err) == (0, "")
    assert read_attributes("muons.h5")["depth_m"] == 13.7
    assert read_attributes("default.h5")["depth_m"] == 10
    assert read_attributes("muons.h5")["model_sha256"] == hashlib.sha256(family_file.read_bytes()).hexdigest()


def test_the_shards_of_a_depth_are_parts_of_its_muons(gen, family_file):
    options = ["--model", family_file, "--depth", "13.7", "-n", "1000", "--seed", 7, "--shard", "2/3"]
    code, _, err = gen(*options, "-o", "muons.h5")
    assert (code, err) == (0, "")
    whole = Generator.open(13.7, file=family_file).sample(1000, seed=7)
    assert np.array_equal(read_muons("muons.h5").kinetic_energy, whole.kinetic_energy[333:666])
    assert read_attributes("muons.h5")["depth_m"] == 13.7


def test_a_depth_that_a_family_of_ones_own_has_not_is_refused_with_the_range(gen, family_file):
    code, out, err = gen("--model", family_file, "--depth", "-1", "-n", "10", "-o", "muons.h5")
    assert (code, out, files()) == (2, "", [])
    assert err == f"deepmuon-gen: no depth of -1 m in {family_file}: there are those from 0 to 100 m\n"


def test_the_version_is_the_distributions(gen):
    code, out, _ = gen("--version")
    assert code == 0
    assert re.fullmatch(r"deepmuon-gen \d+\.\d+\.\d+\S*\n", out)


def test_the_help_teaches_by_an_example(gen):
    code, out, _ = gen("--help")
    assert code == 0
    assert "\n      deepmuon-gen --depth 10 -n 1e7 -o muons.h5\n" in out
    options = """--depth --flux --medium --architecture --model --number --output --seed --device --threads --overwrite
        --shard --list --quiet --version --live-time --area"""
    assert all(option in out for option in options.split())


def test_help_is_there_before_any_library_is_loaded():
    program = (
        "import sys; from deepmuon_cli.gen import main; sys.argv = ['deepmuon-gen', '--help']\n"
        "try: main()\n"
        "except SystemExit: print(sorted({'numpy', 'h5py', 'onnxruntime', 'torch'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("\n[]\n")


def test_neither_torch_nor_onnx_is_needed_for_muons(model_file, tmp_path):
    program = f"""
import sys
sys.modules["torch"] = sys.modules["onnx"] = None  # an import of them fails
sys.argv = ["deepmuon-gen", "--model", {str(model_file)!r}, "-n", "10", "-o", "muons.h5"]
from deepmuon_cli.gen import main
main()
"""
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True)
    assert len(read_muons(tmp_path / "muons.h5")) == 10


GOOD = {"--depth": "10", "-n": "10", "-o": "muons.h5"}


@pytest.mark.usefixtures("released")
@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"-n": "0"}, "0 muons can't be made: the number is from 1 to 2^53"),
        ({"-n": "-5"}, "-5 muons can't be made"),
        ({"-n": "1.5"}, "1.5 is not a whole number"),
        ({"-n": "1e-3"}, "1e-3 is not a whole number"),
        ({"-n": "nan"}, "nan muons can't be made"),
        ({"-n": "inf"}, "inf muons can't be made"),
        ({"-n": str(2**53 + 1)}, "muons can't be made: the number is from 1 to 2^53"),
        ({"-n": "1e999999999"}, "muons can't be made"),
        ({"-n": "many"}, "many is no number: write for instance 1e7"),
        ({"-n": ""}, "is no number"),
        ({"-n": "1e15"}, "1,000,000,000,000,000 muons need 17 PB, and"),
        ({"-n": None}, "how many muons? Give -n"),
        ({"--live-time": "10", "--area": "1"}, "-n goes without --live-time"),
        ({"-n": None, "--live-time": "10"}, "--live-time and --area go together"),
        ({"-n": None, "--area": "1"}, "--live-time and --area go together"),
        ({"-n": None, "--live-time": "0", "--area": "1"}, "0 is not a finite number above 0"),
        ({"-n": None, "--live-time": "10", "--area": "-1"}, "-1 is not a finite number above 0"),
        ({"-n": None, "--live-time": "nan", "--area": "1"}, "nan is not a finite number above 0"),
        ({"-n": None, "--live-time": "1e300", "--area": "1"}, "muons are expected"),
        ({"-n": None, "--live-time": "long", "--area": "1"}, "long is no number of seconds"),
        ({"--seed": "-1"}, "-1 is not from 0 to 2^64 - 1"),
        ({"--seed": str(2**64)}, "is not from 0 to 2^64 - 1"),
        ({"--seed": "0.5"}, "0.5 is not a whole number"),
        ({"--shard": "1/2"}, "--shard needs a --seed"),
        ({"--shard": "1/1"}, "--shard needs a --seed"),
        ({"--shard": "0/2", "--seed": "1"}, "there is no shard 0/2: shard i/k has i from 1 to k"),
        ({"--shard": "3/2", "--seed": "1"}, "there is no shard 3/2"),
        ({"--shard": "1", "--seed": "1"}, "'1' is no shard: write for instance 1/4"),
        ({"--threads": "0"}, "0 threads can't make muons"),
        ({"--threads": "-2"}, "-2 threads can't make muons"),
        ({"--threads": "two"}, "two is not a whole number"),
        ({"--depth": "12"}, "for a depth of 12 m of water: cry in water has 0 and 10 m"),
        ({"--depth": "nan"}, "cry in water has 0 and 10 m"),
        ({"--depth": "deep"}, "deep is no number of metres"),
        ({"--depth": None}, "which muons? Give --depth METRES"),
        ({"--architecture": "flow"}, "there are quantile and transformer"),
        ({"--model": "m.onnx", "--architecture": "quantile"}, "--model goes without --architecture"),
        ({"--model": "m.onnx", "--flux": "cry"}, "--model goes without --flux: the file has its own"),
        ({"--model": "m.onnx", "--medium": "water"}, "--model goes without --medium: the file has its own"),
        ({"--depth": None, "--model": "missing.onnx"}, "No such file"),
        ({"--depth": None, "--model": "."}, "is no ONNX file"),
        ({"--device": "gpu"}, "there are auto, cpu, cuda"),
        ({"-o": None}, "where to?"),
        ({"-o": "."}, "is a folder"),
        ({"-o": "/dev/null"}, "is a device or a pipe"),
        ({"-o": "missing/muons.h5"}, "there is no folder"),
        ({"-o": "/proc/muons.h5"}, "/proc"),
        ({"--dept": "10"}, "--depth"),
    ],
)
def test_what_can_not_be_done_is_refused_in_one_line_and_leaves_nothing(gen, changes, reason):
    options = {**GOOD, **changes}
    arguments = [word for name, value in options.items() if value is not None for word in (name, value)]
    code, out, err = gen(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("deepmuon-gen: ")
    assert err.count("\n") == 1
    assert reason in err
    assert files() == []


def test_a_released_model_that_fails_its_hash_is_refused(gen, released):
    file = released / "deepmuon_models" / "quantile-10m.onnx"
    file.write_bytes(tiny_model(metadata={"depth_m": "11.0"}))
    code, _, err = gen("--depth", 10, "-n", 10, "-o", "muons.h5")
    assert code == 2
    assert "is damaged: its SHA-256 is" in err
    assert files() == []


@pytest.mark.parametrize("content", [b"no ONNX", tiny_model(metadata={"depth_m": None})])
def test_a_file_that_is_no_model_is_refused(gen, model_file, content):
    model_file.write_bytes(content)
    code, _, err = gen("--model", model_file, "-n", 10, "-o", "muons.h5")
    assert code == 2
    assert err.count("\n") == 1
    assert files() == []


def test_a_model_that_gives_a_bad_muon_is_a_failure_that_leaves_nothing(gen, model_file):
    model_file.write_bytes(tiny_model(edits=RARELY_BAD))
    code, out, err = gen("--model", model_file, "-n", "1e6", "-o", "muons.h5", "--seed", 1)
    assert (code, out) == (1, "")
    assert re.search(r"bad muon: number \d+ has a kinetic energy outside", err)
    assert files() == []


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["Ctrl-C", "SIGTERM"])
def test_a_stopped_command_leaves_nothing(model_file, tmp_path, number, code):
    folder = tmp_path / "here"
    folder.mkdir()
    process = subprocess.Popen(
        [*COMMAND, "--model", str(model_file), "-n", "1e8", "-o", "muons.h5"],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for_partial_file(folder)
    process.send_signal(number)
    _, err = process.communicate(timeout=600)
    assert process.returncode == code
    assert err == f"deepmuon-gen: stopped by {number.name}\n"
    assert list(folder.iterdir()) == []


def wait_for_partial_file(folder: Path) -> None:
    """Wait until muons are being written."""
    end = time.monotonic() + 600
    while not any(path.stat().st_size > 1_000_000 for path in folder.glob("*.deepmuon-partial")):
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_bar_shows_the_progress_on_a_terminal(model_file, tmp_path):
    terminal, stderr = pty.openpty()
    subprocess.run(
        [*COMMAND, "--model", str(model_file), "-n", "3e5", "-o", "muons.h5"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        check=True,
    )
    os.close(stderr)
    assert b"100%" in os.read(terminal, 10_000)
    os.close(terminal)


@pytest.mark.usefixtures("released")
@pytest.mark.parametrize(
    ("asked", "number", "opened"),
    [
        ([], "1e8", "cpu"),
        ([], "2e8", "auto"),
        (["--architecture", "transformer"], "1e8", "auto"),
        (["--device", "cuda"], "10", "cuda"),
        (["--device", "cpu"], "2e8", "cpu"),
    ],
)
def test_a_gpu_is_started_where_it_is_the_faster_one(gen, monkeypatch, asked, number, opened):
    """Of the released models `quantile` is so fast on a processor that a GPU would begin too late."""

    def open_on(*_: object, device: str, **__: object) -> None:
        raise RefusedError(f"opened on {device}")

    monkeypatch.setattr(Generator, "open", open_on)
    code, _, err = gen("--depth", 10, *asked, "-n", number, "-o", "muons.h5")
    assert (code, err.splitlines()[-1]) == (2, f"deepmuon-gen: opened on {opened}")


def test_a_log_gets_a_line_of_progress_every_half_minute(gen, model_file, monkeypatch):
    """A clock on which each look is 10 s after the one before."""
    ticks = iter(range(0, 10**6, 10))
    monkeypatch.setattr("deepmuon_cli.gen.time.monotonic", lambda: next(ticks))
    code, _, err = gen("--model", model_file, "-n", "1.2e6", "-o", "muons.h5", "--seed", 1)
    assert code == 0
    lines = err.splitlines()
    assert len(lines) == 3  # of ten pieces
    assert all(re.fullmatch(r"deepmuon-gen: [\d,]+ of 1,200,000 muons", line) for line in lines)


def test_a_warning_is_one_line(gen, model_file, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    for package in ("onnxruntime", "onnxruntime_gpu"):
        metadata = tmp_path / f"{package}-1.20.0.dist-info" / "METADATA"
        metadata.parent.mkdir()
        metadata.write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.20.0\n")
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); from deepmuon_cli.gen import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", program, "--model", str(model_file), "-n", "10", "-o", "muons.h5"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr.startswith("deepmuon-gen: warning: onnxruntime and onnxruntime-gpu are both installed")
    assert done.stderr.count("\n") == 1


def test_an_option_that_is_misspelt_is_told_with_the_nearest_one(gen):
    assert gen("--dept", "10") == (2, "", "deepmuon-gen: there is no option --dept; did you mean --depth?\n")


@pytest.mark.usefixtures("released")
@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("", "which muons? Give --depth METRES"),
        ("10", "10 stands alone, without an option before it; did you mean --depth 10 or -n 10?"),
        ("--depth 10 1e6", "did you mean -n 1e6?"),
        ("--depth 10 -n 1e6 muons.h5", "did you mean -o muons.h5?"),
        ("mine.onnx -n 10", "did you mean --model mine.onnx?"),
        ("list", "did you mean --list?"),
        ("water --depth 10", "did you mean --medium water?"),
        ("--depth 10 --flux cry measured", "measured stands alone"),
        ("--depth 15", "for a depth of 15 m of water: cry in water has 0 and 10 m"),
        ("--depth 10m", "10m is no number of metres: write 10"),
        ("--depth 1.5km", "write 1500"),
        ("--depth 1000mwe", "1000mwe is no number of metres: write 1000 for water, 377.36 for rock"),
        ("--depth 6kmwe", "write 6000 for water, 2264.2 for rock"),
        ("--depth 10,5", "write 10.5"),
        ("--depth 1,000", "write 1000 or 1"),
        ("--live-time 1h", "1h is no number of seconds: write 3600"),
        ("--live-time 1.5min", "write 90"),
        ("--live-time 2days", "write 172800"),
        ("--live-time 1,5", "write 1.5"),
        ("--area 4m2", "4m2 is no number of m2: write 4"),
        ("--area 50cm²", "write 0.005"),
        ("-n 10M", "10M is no number: write 1e7"),
        ("-n 1,5k", "write 1500"),
        ("-n 10,000", "write 10000"),
        ("-n 1,234,567", "write 1234567"),
        ("-n 1,5", "write for instance 1e7"),
        ("-n 2.5", "2.5 is not a whole number: write 3"),
        ("--seed 1e3", "write 1000"),
        ("--seed 0x1F", "write 31"),
        ("--threads 4.0", "write 4"),
        ("--arch quantile", "there is no option --arch; did you mean --architecture?"),
        ("--out muons.h5", "did you mean --output?"),
        ("--Depth 10", "did you mean --depth?"),
        ("--depht 10", "did you mean --depth?"),
        ("--charge 1", "keep those you want when you read the file"),
        ("--material G4_ROCK", "deepmuon-train transport takes muons through other materials"),
        ("--density 2.7", "water has 1 g/cm3 and rock 2.65; deepmuon-train source makes muons under others"),
        ("--rock", "there is no option --rock; write --medium rock"),
        ("--water", "write --medium water"),
        ("--measured", "write --flux measured"),
        ("--cry", "write --flux cry"),
        ("--mwe 1000", "write --depth METRES, of --medium water or --medium rock"),
        ("--fluks cry", "did you mean --flux?"),
        ("--flux", "Option '--flux' requires an argument"),
        ("--csv", "the end of the file's name says its format: -o muons.mcpl"),
        ("--format text -o muons.h5", "'text' is not one of 'h5', 'mcpl', 'mcpl.gz', 'root', 'csv', 'csv.gz'"),
        ("--gpu", "write --device cuda"),
        ("--xyzzy", "deepmuon-gen --help lists"),
    ],
)
def test_a_mistyped_call_gets_an_answer_that_leads_on(gen, line, answer):
    code, out, err = gen(*line.split())
    assert (code, out) == (2, "")
    assert err.startswith("deepmuon-gen: ")
    assert err.count("\n") == 1
    assert answer in err
    assert files() == []


def test_messages_have_colours_on_a_terminal_only(tmp_path):
    asked = [*COMMAND, "-n", "1"]
    piped = subprocess.run(asked, capture_output=True, cwd=tmp_path, check=False).stderr
    controller, terminal = pty.openpty()
    subprocess.run(asked, stderr=terminal, cwd=tmp_path, check=False)
    os.close(terminal)
    shown = os.read(controller, 10_000)
    os.close(controller)
    assert b"\x1b[" not in piped
    assert b"\x1b[31mdeepmuon-gen:\x1b[0m which muons?" in shown


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("--de", ["--depth", "--device"]),
        ("--depth ", ["0", "100"]),
        ("--flux measured --depth ", ["0", "5000"]),
        ("--flux measured --medium rock --depth 2", ["2500"]),
        ("--architecture transformer --depth ", ["10"]),
        ("--medium rock --depth ", []),
        ("--architecture t", ["transformer"]),
        ("--flux measured --architecture ", ["quantile"]),
        ("--flux ", ["cry", "measured"]),
        ("--medium rock --flux ", ["measured"]),
        ("--medium ", ["rock", "water"]),
        ("--flux cry --medium ", ["water"]),
        ("--device cu", ["cuda"]),
    ],
)
def test_the_shell_completes_options_and_their_values(released_families, words, offered):
    line = f"deepmuon-gen {words}"
    environment = with_models(released_families) | {
        "_DEEPMUON_GEN_COMPLETE": "bash_complete",
        "COMP_WORDS": line,
        "COMP_CWORD": str(line.count(" ")),
    }
    done = subprocess.run(COMMAND, env=environment, capture_output=True, text=True, check=True)
    assert sorted(done.stdout.split()) == [f"plain,{word}" for word in offered]
