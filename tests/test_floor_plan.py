"""Imports go one way: training and cli know the runtime, and no room uses one that stands on it."""

from __future__ import annotations

import ast
from itertools import pairwise

import pytest

from studies.pictures.imports import PACKAGES, Import, arrows, circle, imports, modules, package, room

MODULES = modules()
IMPORTS = imports(MODULES)
ROOMS = sorted({name for name, path in MODULES.items() if path.name == "__init__.py"})
HEAVY = {"onnx", "torch"}
COMMANDS = "deepmuon_training.commands"


def told(found: list[Import]) -> str:
    return "\n".join(dict.fromkeys(f"{place}: {importer} imports {imported}" for importer, imported, place in found))


def going(way: list[str], rooms: bool) -> str:
    """The circle, and the lines that make it."""
    steps = list(pairwise(way))

    def end(module: str) -> str:
        return room(module, MODULES) if rooms and module in MODULES else module

    lines = [one for one in IMPORTS if (end(one.importer), end(one.imported)) in steps]
    return f"imports go in a circle: {' -> '.join(way)}\n{told(lines)}"


@pytest.mark.parametrize("rooms", [False, True], ids=["modules", "rooms"])
def test_imports_never_go_in_a_circle_not_even_for_types(rooms: bool):
    way = circle(arrows(IMPORTS, MODULES, rooms))
    assert not way, going(way, rooms)


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("deepmuon_runtime", set()),
        ("deepmuon_cli", {"deepmuon_runtime"}),
        ("deepmuon_training", {"deepmuon_runtime", "deepmuon_cli", *HEAVY}),
    ],
)
def test_a_package_knows_only_what_stands_under_it(name: str, known: set[str]):
    strange = (PACKAGES.keys() | HEAVY) - known - {name}
    found = [one for one in IMPORTS if package(one.importer) == name and package(one.imported) in strange]
    assert not found, f"{name} must do without {', '.join(sorted(strange))}, and:\n{told(found)}"


def test_only_the_commands_of_training_use_the_command_line():
    found = [
        one
        for one in IMPORTS
        if package(one.importer) == "deepmuon_training"
        and package(one.imported) == "deepmuon_cli"
        and room(one.importer, MODULES) != COMMANDS
    ]
    assert not found, f"only {COMMANDS} may use deepmuon_cli, and:\n{told(found)}"


def test_nothing_imports_the_commands():
    found = [
        one
        for one in IMPORTS
        if f"{one.imported}.".startswith(f"{COMMANDS}.") and room(one.importer, MODULES) != COMMANDS
    ]
    assert not found, f"nothing may import {COMMANDS}, and:\n{told(found)}"


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_has_two_to_thirteen_things_in_it(name: str):
    inside = [module for module in MODULES if module.rpartition(".")[0] == name]
    files = [module for module in inside if module not in ROOMS]
    assert len(inside) >= 2, f"{name} has {', '.join(inside) or 'nothing'} alone: a room is for more than one thing"
    assert len(files) <= 13, f"{name} has {len(files)} modules, and should have at most 13: {', '.join(files)}"


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_says_in_five_lines_at_most_what_it_is_for(name: str):
    text = ast.get_docstring(ast.parse(MODULES[name].read_text(encoding="utf-8")))
    assert text, f"{MODULES[name]} has no docstring"
    assert len(text.splitlines()) <= 5, f"the docstring of {MODULES[name]} has more than five lines"


def test_every_folder_of_modules_is_a_room():
    folders = {module.rpartition(".")[0] for module in MODULES} - {""}
    assert folders <= set(ROOMS), f"no __init__.py in {', '.join(sorted(folders - set(ROOMS)))}"
