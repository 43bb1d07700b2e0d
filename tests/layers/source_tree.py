# SPDX-License-Identifier: BSD-3-Clause
"""Reads which module of the source tree imports which, without running any of them.

Imports inside functions and those for the type checker alone count too.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Import:
    """One module imports another.

    Attributes:
        importer: Dotted name of a module of the tree.
        imported: Dotted name of a module of the tree (or of one generated into it), or of a package outside it.
        line: Line of the first such import in the importer.
    """

    importer: str
    imported: str
    line: int


@dataclass(frozen=True, slots=True)
class SourceTree:
    """All modules of a catkin source folder, and what they import.

    Attributes:
        folders: Python package -> folder of the catkin package that holds it, below the source folder.
        files: Dotted name of each module -> its file, below the parent of the source folder.
        imports: Sorted by file, then by line.
    """

    folders: dict[str, str]
    files: dict[str, str]
    imports: tuple[Import, ...]

    def internal_imports(self) -> list[Import]:
        """Returns the imports between modules of the tree."""
        return [each for each in self.imports if each.imported in self.files]

    def is_folder(self, name: str) -> bool:
        """Returns whether a module is a folder of modules."""
        return self.files.get(name, "").endswith("/__init__.py")


def package_of(module: str) -> str:
    """Returns the first part of a dotted name."""
    return module.partition(".")[0]


def leads_to(start: str, end: str, edges: set[tuple[str, str]]) -> bool:
    """Returns whether edges lead from one node to another."""
    reached, frontier = {start}, [start]
    while frontier:
        node = frontier.pop()
        following = {other for one, other in edges if one == node} - reached
        reached |= following
        frontier += following
    return end in reached


def read_source_tree(source: Path) -> SourceTree:
    """Reads a catkin source folder: the Python packages `*/src/*` and `*/*/src/*`."""
    roots = sorted(file.parent for depth in ("*", "*/*") for file in source.glob(f"{depth}/src/*/__init__.py"))
    folders = {root.name: str(root.parents[1].relative_to(source)) for root in roots}
    paths = {_module_name(root, file): file for root in roots for file in sorted(root.rglob("*.py"))}
    imports: dict[tuple[str, str], Import] = {}
    for importer, path in paths.items():
        for imported, line in _read_imports(importer, path, paths):
            name = imported if package_of(imported) in folders else package_of(imported)
            if name != importer:
                imports.setdefault((importer, name), Import(importer, name, line))
    return SourceTree(
        folders=folders,
        files={name: str(path.relative_to(source.parent)) for name, path in paths.items()},
        imports=tuple(imports.values()),
    )


def _module_name(root: Path, file: Path) -> str:
    parts = file.relative_to(root.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _read_imports(importer: str, path: Path, modules: dict[str, Path]) -> Iterator[tuple[str, int]]:
    """Yields the modules that one imports, each with its line; of `from a import b` a.b where that is a module."""
    depth = importer.count(".") + (path.name == "__init__.py")  # of the folder that the file lies in
    nodes = ast.walk(ast.parse(path.read_text(), path))
    imports = [node for node in nodes if isinstance(node, (ast.Import, ast.ImportFrom))]
    for node in sorted(imports, key=lambda node: node.lineno):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
            continue
        above = importer.split(".")[: depth - node.level + 1] if node.level else []
        origin = ".".join([*above, *filter(None, [node.module])])
        for alias in node.names:
            name = f"{origin}.{alias.name}"
            yield (name if name in modules or alias.name in ("msg", "srv") else origin), node.lineno
