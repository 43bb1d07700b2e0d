# SPDX-License-Identifier: BSD-3-Clause
"""Checks the imports of a source tree against the table of layers."""

from __future__ import annotations

import graphlib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import PurePosixPath

from layer_table import LayerTable
from source_tree import Import, SourceTree, leads_to, package_of

_TABLE = "tests/layers/layers.toml"


def fault(where: str, found: str, allowed: str, remedy: str) -> str:
    """Writes a fault.

    Args:
        where: File and line, or folder.
        found: What stands there.
        allowed: What the table allows.
        remedy: What to do.
    """
    return f"{where}: {found}; allowed: {allowed}; {remedy}"


def find_faults(tree: SourceTree, table: LayerTable) -> list[str]:
    """Returns everything that breaks the table and that it does not exempt, and exemptions that nothing needs."""
    broken = [*package_faults(tree, table), *room_faults(tree, table), *ros_faults(tree, table)]
    exempt = {each for each in tree.imports if any(entry.covers(each) for entry in table.exemptions)}
    edges = {(each.importer, each.imported) for each in tree.internal_imports()}
    needed = {each for each, _ in broken} | {each for each in exempt if leads_to(each.imported, each.importer, edges)}
    return [
        *unlisted_packages(tree, table),
        *unlisted_rooms(tree, table),
        *full_folders(tree, table),
        *missing_modules(tree, table),
        *(text for each, text in broken if each not in exempt),
        *circles(tree, exempt),
        *(
            fault(
                _TABLE,
                f"the exemption of {entry.importer} -> {entry.imported} is no longer needed",
                "exemptions of imports that break a rule",
                "delete it",
            )
            for entry in table.exemptions
            if not any(entry.covers(each) for each in needed)
        ),
    ]


def unlisted_packages(tree: SourceTree, table: LayerTable) -> Iterator[str]:
    """Finds packages that the table does not know."""
    for package, folder in sorted(tree.folders.items()):
        if table.allowed_packages(package, folder) is None:
            yield fault(
                f"src/{folder}",
                f"the table has no entry for package '{package}'",
                "packages of the table",
                f"say in {_TABLE}, [packages], what it may import",
            )


def unlisted_rooms(tree: SourceTree, table: LayerTable) -> Iterator[str]:
    """Finds rooms that the table does not know, and rooms of the table that are gone."""
    for owner in sorted({*tree.folders, *table.rooms}):
        listed = {room for level in table.levels(owner) for room in level}
        present = {room for name in tree.files if (room := room_of(name, owner, tree))}
        if not listed and present <= {"."}:
            continue
        for room in sorted(present - listed):
            folder = tree.files.get(owner, owner).removesuffix("/__init__.py")
            where, found = f"{folder}/{room}", f"'{room}' is not one of the rooms of {owner}"
            if room == ".":
                where, found = folder, "modules lie outside every room"
            yield fault(
                where,
                found,
                ", ".join(sorted(listed)) or "no rooms",
                f"move its modules into a room, or add it to {_TABLE}, [rooms]",
            )
        for room in sorted(listed - present):
            yield fault(_TABLE, f"{owner} has no room '{room}'", ", ".join(sorted(present)), "delete it from [rooms]")


def full_folders(tree: SourceTree, table: LayerTable) -> Iterator[str]:
    """Finds folders with too many modules."""
    modules = (PurePosixPath(file) for file in tree.files.values())
    for folder, count in sorted(Counter(str(file.parent) for file in modules if file.name != "__init__.py").items()):
        if count > table.max_modules_in_a_folder:
            yield fault(
                folder,
                f"{count} modules in one folder",
                f"at most {table.max_modules_in_a_folder}",
                "divide it into rooms named after the field's nouns",
            )


def missing_modules(tree: SourceTree, table: LayerTable) -> Iterator[str]:
    """Finds imports of modules that a package of the tree does not have, generated ones aside."""
    for each in tree.imports:
        package = package_of(each.imported)
        if package in tree.folders and each.imported not in tree.files and not table.is_ros(each.imported):
            yield fault(
                _where(tree, each),
                f"imports {each.imported}, which does not exist",
                f"modules of {package}",
                "correct the name, or add the module",
            )


def package_faults(tree: SourceTree, table: LayerTable) -> Iterator[tuple[Import, str]]:
    """Finds imports between packages that the table does not allow."""
    for each in tree.internal_imports():
        importer, imported = package_of(each.importer), package_of(each.imported)
        allowed = table.allowed_packages(importer, tree.folders[importer])
        if importer != imported and allowed is not None and imported not in allowed:
            yield (
                each,
                fault(
                    _where(tree, each),
                    f"{importer} imports {each.imported}",
                    ", ".join(allowed) or "no package",
                    "move what is shared into a package below both, or pass it in",
                ),
            )


def room_faults(tree: SourceTree, table: LayerTable) -> Iterator[tuple[Import, str]]:
    """Finds imports that run upwards, or sideways between rooms of one level."""
    for owner in table.rooms:
        levels = table.levels(owner)
        height = {room: index for index, level in enumerate(levels) for room in level}
        for each in tree.internal_imports():
            upper, lower = room_of(each.importer, owner, tree), room_of(each.imported, owner, tree)
            if upper == lower or upper not in height or lower not in height or height[lower] < height[upper]:
                continue
            below = ", ".join(room for level in levels[: height[upper]] for room in level)
            yield (
                each,
                fault(
                    _where(tree, each),
                    f"{owner}'s room '{upper}' imports {each.imported}",
                    below or "no other room",
                    "move what is shared down, or pass it in",
                ),
            )


def ros_faults(tree: SourceTree, table: LayerTable) -> Iterator[tuple[Import, str]]:
    """Finds modules below the ROS interface that import a client or message of ROS, or a module of the interface."""
    for each in tree.imports:
        inside = each.imported in tree.files
        reaches_ros = table.may_use_ros(each.imported) if inside else table.is_ros(each.imported)
        if reaches_ros and not table.may_use_ros(each.importer):
            allowed = ", ".join(["ros_*", *table.ros_interface.get(package_of(each.importer), [])])
            yield (
                each,
                fault(
                    _where(tree, each),
                    f"{each.importer} imports {each.imported} below the ROS interface",
                    f"in {allowed} of the package",
                    "move it to the ROS interface, or pass in what it needs",
                ),
            )


def circles(tree: SourceTree, exempt: set[Import]) -> Iterator[str]:
    """Finds circles of files, not counting exempted imports. No two that it yields share an import."""
    imports = {(each.importer, each.imported): each for each in tree.internal_imports() if each not in exempt}
    while names := _find_circle(imports):
        circle = [imports.pop(step) for step in zip(names, names[1:], strict=False)]
        yield fault(
            _where(tree, circle[0]),
            f"the circle {' -> '.join(names)}",
            "no circle of files",
            "move what they share into a module below both, or pass it in",
        )


def _find_circle(imports: Iterable[tuple[str, str]]) -> list[str]:
    """Returns the modules of a circle, each importing the next; the first by name stands at both ends."""
    graph: dict[str, list[str]] = {}
    for importer, imported in sorted(imports):
        graph.setdefault(importer, []).append(imported)
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        names = error.args[1][:0:-1]
        first = names.index(min(names))
        return [*names[first:], *names[: first + 1]]
    return []


def room_of(module: str, owner: str, tree: SourceTree) -> str:
    """Returns the room of a package (or room) that a module lies in, "." directly in it, "" outside it."""
    if not module.startswith(f"{owner}."):
        return ""
    room = module[len(owner) + 1 :].partition(".")[0]
    return room if tree.is_folder(f"{owner}.{room}") else "."


def _where(tree: SourceTree, each: Import) -> str:
    return f"{tree.files[each.importer]}:{each.line}"
