from __future__ import annotations

import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.transport.material import check_material, known_materials, medium


def test_the_medium_says_a_density_that_is_not_the_materials_own() -> None:
    assert medium("G4_WATER", None) == "G4_WATER"
    assert medium("G4_WATER", 1.025) == "G4_WATER 1.025 g/cm3"


def test_standard_rock_is_the_same_medium_whether_its_usual_density_is_stated_or_not() -> None:
    assert medium("standard_rock", None) == medium("standard_rock", 2.65) == "standard_rock 2.65 g/cm3"


def test_geant4_names_its_materials_and_standard_rock_is_one_more() -> None:
    assert {"G4_WATER", "G4_CONCRETE", "G4_CALCIUM_CARBONATE", "G4_Pb", "standard_rock"} <= set(known_materials())


@pytest.mark.parametrize("name", ["", "G4_CHEESE", "g4_water", "G4_WATER\nG4_CONCRETE"])
def test_what_is_no_name_of_a_material_is_refused(name: str) -> None:
    with pytest.raises(RefusedError, match="no material"):
        check_material(name, None)


def test_a_misspelt_name_is_answered_with_the_right_one() -> None:
    with pytest.raises(RefusedError, match="standard_rock"):
        check_material("standard-rock", 2.65)
