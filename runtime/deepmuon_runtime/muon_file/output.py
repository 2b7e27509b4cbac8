"""Whether muons can be written, as HDF5, where they are wanted: asked once by all who write them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.files.output import check_output

__all__ = ["check_muon_output", "refuse_stdout"]

BY_CONVERT = "deepmuon-convert {stem}.h5 {name}"
AS_CSV = "deepmuon-convert {stem}.h5 {stem}.csv"
BY_PYTHON = "read it in Python with deepmuon_runtime.read_muons, and write {name} from there"
OTHER_FORMATS = {
    ".csv": ("text", BY_CONVERT),
    ".txt": ("text", AS_CSV),
    ".dat": ("text", AS_CSV),
    ".csv.gz": ("packed text", BY_CONVERT),
    ".mcpl.gz": ("packed MCPL", BY_CONVERT),
    ".gz": ("a packed file", "deepmuon-convert {stem}.h5 {stem}.csv.gz"),
    ".zip": ("a compressed file", "compress that"),
    ".root": ("ROOT", BY_CONVERT),
    ".parquet": ("Parquet", BY_PYTHON),
    ".feather": ("Arrow", BY_PYTHON),
    ".npy": ("NumPy", BY_PYTHON),
    ".npz": ("NumPy", BY_PYTHON),
    ".json": ("JSON", BY_PYTHON),
    ".mcpl": ("MCPL", BY_CONVERT),
    ".onnx": ("a model", "muons are no model"),
    ".png": ("a picture", "deepmuon-plot {stem}.h5 -o {name}"),
    ".pdf": ("a picture", "deepmuon-plot {stem}.h5 -o {name}"),
    ".svg": ("a picture", "deepmuon-plot {stem}.h5 -o {name}"),
}
"""What the ends of names promise that is not HDF5, and how to come to it; a longer end before its own."""


def refuse_stdout(path: str | Path) -> None:
    """Refuse -, which stands for stdout elsewhere: no file of muons can go there."""
    if str(path) == "-":
        raise RefusedError(
            "- is no name of a muon file, which can't go to stdout: give one, as in -o muons.h5, and then write it as "
            "text by deepmuon-convert muons.h5 -"
        )


def check_muon_output(path: str | Path, overwrite: bool = False, inputs: Iterable[str | Path] = ()) -> Path:
    """Tell whether muons can be written at `path`, before the work for them begins.

    Parameters
    ----------
    path, overwrite, inputs
        As for `deepmuon_runtime.files.output.check_output`.

    Returns
    -------
    The absolute path, links followed.

    Raises
    ------
    RefusedError
        As `check_output`, and if the name promises what is not HDF5: the name of another format, or - for stdout.
    """
    check_output(path, True, inputs)  # first of all: what is read is never replaced, whatever its name
    name = Path(path).name
    refuse_stdout(path)
    ending = next((ending for ending in OTHER_FORMATS if name.lower().endswith(ending)), None)
    if ending is not None:
        form, way = OTHER_FORMATS[ending]
        stem = name[: -len(ending)]
        if ending == ".gz":
            stem = Path(stem).stem
        raise RefusedError(
            f"{path} would be HDF5 under a name of {form}: write {stem}.h5, and then {way.format(stem=stem, name=name)}"
        )
    return check_output(path, overwrite, inputs)
