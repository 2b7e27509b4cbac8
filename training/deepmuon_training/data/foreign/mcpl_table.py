"""Particles in MCPL, the exchange format of Monte Carlo programs (T. Kittelmann et al., CPC 218 (2017) 17)."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_training.data.foreign.table import Float, Place, Table, numbered

__all__ = ["open_mcpl"]

PIECE = 1 << 18  # particles read at once

FIELDS = {"pdg_id": "pdgcode", "ekin [MeV]": "ekin", "ux": "ux", "uy": "uy", "uz": "uz", "weight": "weight"}
"""Headings, and what the package calls them."""


def open_mcpl(path: str | Path) -> Table:
    """Open the particles of an MCPL file, which may be packed by gzip if its name ends with .gz.

    Raises
    ------
    RefusedError
        Here or while its rows are read: if the package `mcpl` is missing, or the file can't be read or has no particle.
    """
    try:
        import mcpl
    except ImportError as error:
        raise RefusedError("to read MCPL, mcpl is needed: pip install 'deepmuon-training[mcpl]'") from error

    said = io.StringIO()  # the package prints its warnings
    try:
        with redirect_stdout(said):
            file = mcpl.MCPLFile(str(path), blocklength=PIECE)
    except Exception as error:  # whatever a damaged file makes it raise
        raise RefusedError(f"{path} can't be read as an MCPL file: {reason(error)}") from error
    if said.getvalue():
        warnings.warn(f"{path}: {' '.join(said.getvalue().split())}", stacklevel=2)
    if not file.nparticles:
        raise RefusedError(f"{path} has no particle")

    def rows(wanted: Sequence[int]) -> Iterator[tuple[Place, Float]]:
        names = [list(FIELDS.values())[i] for i in wanted]
        first = 0
        try:
            for block in file.particle_blocks:
                piece = np.stack([np.asarray(getattr(block, name), np.float64) for name in names], axis=1)
                yield numbered(path, "particle", first), piece
                first += len(piece)
        except mcpl.MCPLError as error:
            raise RefusedError(f"{path} can't be read after particle {first}: {reason(error)}") from error

    return Table(path, len(FIELDS), rows, tuple(FIELDS))
