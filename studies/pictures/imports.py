"""What the packages' modules import, read from their code, and which rooms that ties together.

A room is a folder of modules. A module that stands beside the rooms, in the package itself, counts as one of its own.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from studies.shared.processes import REPOSITORY

__all__ = ["PACKAGES", "Arrows", "Import", "Modules", "arrows", "circle", "imports", "modules", "package", "room"]

PACKAGES = {"deepmuon_runtime": "runtime", "deepmuon_cli": "cli", "deepmuon_training": "training", "studies": "."}
"""Packages and the folders that they lie in."""

Modules = dict[str, Path]
"""Files of modules by name; an `__init__` has the name of its folder."""

Arrows = dict[str, set[str]]
"""Names, and the names that each of them uses."""


class Import(NamedTuple):
    """One module that another one names."""

    importer: str
    imported: str
    """A module of ours, or whatever else is imported, with its name in full."""
    place: str
    """File and line."""


def package(module: str) -> str:
    """Return the package of a module."""
    return module.partition(".")[0]


def modules(packages: Iterable[str] = PACKAGES) -> Modules:
    """Find the modules of packages."""
    found: Modules = {}
    for name in packages:
        folder = REPOSITORY / PACKAGES[name]
        for path in sorted((folder / name).rglob("*.py")):
            *parts, last = path.relative_to(folder).with_suffix("").parts
            found[".".join(parts if last == "__init__" else [*parts, last])] = path
    return found


def imports(files: Modules) -> list[Import]:
    """Read what modules import, in functions and for types too.

    A name that a package's `__init__` has from another module of ours counts as an import of both.
    """
    named = {module: list(_named(module, path, files)) for module, path in files.items()}
    behind = {
        f"{module}.{name}": source for module in files for source, name, _ in named[module] if _is_init(files[module])
    }
    found = []
    for module, path in files.items():
        for source, name, line in named[module]:
            place = f"{path.relative_to(REPOSITORY).as_posix()}:{line}"
            found.append(Import(module, source, place))
            if source in files and f"{source}.{name}" in behind:
                found.append(Import(module, behind[f"{source}.{name}"], place))
    return found


def _named(module: str, path: Path, files: Collection[str]) -> Iterator[tuple[str, str, int]]:
    """Yield each module that is named, what is taken from it, and the line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "", node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")[: -node.level if not _is_init(path) else 1 - node.level or None]
            source = ".".join([*(above if node.level else []), *filter(None, [node.module])])
            for alias in node.names:
                inside = f"{source}.{alias.name}"
                yield (inside, "", node.lineno) if inside in files else (source, alias.name, node.lineno)


def _is_init(path: Path) -> bool:
    return path.name == "__init__.py"


def room(module: str, files: Modules) -> str:
    """Return the room of a module, which is itself if it stands in none."""
    folder = module if _is_init(files[module]) else module.rpartition(".")[0]
    return folder if "." in folder else module


def arrows(found: Iterable[Import], files: Modules, rooms: bool) -> Arrows:
    """Return which modules use which, or which rooms.

    Between rooms a package's own `__init__` is left out: it is the front door, and shows what stands behind it.
    """
    result: Arrows = {}
    for module in files:
        if not rooms or module not in PACKAGES:
            result.setdefault(room(module, files) if rooms else module, set())
    for importer, imported, _ in found:
        if imported not in files or (rooms and {importer, imported} & PACKAGES.keys()):
            continue
        a, b = (room(module, files) if rooms else module for module in (importer, imported))
        if a != b:
            result[a].add(b)
    return result


def circle(uses: Mapping[str, Collection[str]]) -> list[str]:
    """Return names of which each uses the next one and the last one is the first, or none."""
    done: set[str] = set()

    def search(name: str, path: list[str]) -> list[str]:
        if name in path:
            return [*path[path.index(name) :], name]
        if name in done:
            return []
        for other in sorted(uses[name]):
            if found := search(other, [*path, name]):
                return found
        done.add(name)
        return []

    return next((found for name in sorted(uses) if (found := search(name, []))), [])
