"""Geant4 without its data sets.

`geant4_pybind` asks for a download of gigabytes when it is imported and finds no data sets, and Geant4 stops at its
start where one is missing. The electromagnetic processes of a muon, and its decay, compute their tables themselves and
read none.
"""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["without_data_sets"]

_VARIABLES = (
    "GEANT4_DATA_DIR",
    "G4ENSDFSTATEDATA",
    "G4LEDATA",
    "G4LEVELGAMMADATA",
    "G4PARTICLEXSDATA",
    "G4RADIOACTIVEDATA",
)

_NOTHING = Path(__file__).with_name("geant4_no_data")  # its table of ions is empty: Geant4 asks that the file exists


def without_data_sets() -> dict[str, str]:
    """Return the environment of this process, completed so that Geant4 starts without its data sets, asking for none.

    Data sets that the user has named stay. The environment has to be in place before `geant4_pybind` is imported: give
    it to a process to come, or update `os.environ`.

    Returns
    -------
    dict
        All variables of the environment.

    Examples
    --------
    >>> import os
    >>> os.environ.update(without_data_sets())
    """
    return {**dict.fromkeys(_VARIABLES, str(_NOTHING)), **os.environ}
