"""The fluxes that a command can be asked for, by their names."""

from __future__ import annotations

from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.fluxes.ecomug import ecomug
from deepmuon_training.fluxes.flux import CHARGE_RATIO, Flux
from deepmuon_training.fluxes.gccly import gccly
from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.table import read_flux_table

__all__ = ["find_flux"]

_OF_ONE_RATIO = {"gccly": gccly, "ecomug": ecomug}


def find_flux(name: str, charge_ratio: float | None = None) -> Flux:
    """Return a flux by its name, or read the table of this name.

    Parameters
    ----------
    name
        measured, gccly, ecomug, or the path of a table as of `deepmuon_training.fluxes.table.read_flux_table`.
    charge_ratio
        mu+ for each mu-, of a formula that knows no charge: gccly and ecomug. 1.28 if None.

    Raises
    ------
    RefusedError
        If there is neither such a flux nor such a file, the table is none, or the charge ratio is the flux's own.
    """
    if name in _OF_ONE_RATIO:
        return _OF_ONE_RATIO[name](CHARGE_RATIO if charge_ratio is None else charge_ratio)
    if name != MEASURED.name and not Path(name).exists():
        raise RefusedError(f"there is no flux and no file {name!r}: expected was measured, gccly, ecomug or a table")
    if charge_ratio is not None:
        raise RefusedError(f"the flux {name} has charges of its own: no charge ratio can be asked of it")
    return MEASURED if name == MEASURED.name else read_flux_table(name)
