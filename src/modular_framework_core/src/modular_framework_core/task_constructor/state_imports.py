# SPDX-License-Identifier: BSD-3-Clause
"""Checks that Python finds the modules that a state's file imports, without importing or running any of them."""

from __future__ import annotations

import ast
import importlib.util
import pkgutil
import sys
from collections.abc import Iterator, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from modular_framework_core.files.faults import nearest

_PATH_CHANGES = ("sys.path", "sys.modules", "sys.meta_path", "addsitedir", "__path__")
"""Words of a file that may change what is found, which only running it would show."""


def missing_imports(tree: ast.Module, file: Path) -> tuple[str, ...]:
    """Says what a file imports that is not found; nothing where only running it would show.

    Only the imports at the top of the file count, which are run when it is loaded: not those in ``try``, ``if`` or
    functions, and no names within modules.

    Args:
        tree: The file as parsed.
        file: Its absolute path.

    Returns:
        One message for each import that would fail, beginning with file and line.
    """
    if _changes_import_path(file):
        return ()
    found: list[str] = []
    for line, name in _top_imports(tree, file):
        wrong = _complaint(name, file)
        if wrong:
            found.append(f"{file}:{line} imports '{name}', but {wrong}")
    return tuple(found)


def _top_imports(tree: ast.Module, file: Path) -> Iterator[tuple[int, str]]:
    """Yields line and module of each import; a relative one by its full name, or as it is written outside packages."""
    package = _package_of(file)
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, item.name) for item in node.names)
        elif isinstance(node, ast.ImportFrom):
            relative = "." * node.level + (node.module or "")
            yield (
                node.lineno,
                importlib.util.resolve_name(relative, package)
                if node.level and package and (node.level <= package.count(".") + 1)
                else relative,
            )


def _package_of(file: Path) -> str:
    folders: list[str] = []
    for folder in file.parents:
        if not (folder / "__init__.py").is_file():
            break
        folders.insert(0, folder.name)
    return ".".join(folders)


def _complaint(name: str, file: Path) -> str:
    """Says which part of a module's name is not found, and what to do; nothing when all of it may be there."""
    if name.startswith("."):
        return f"{file.parent} is no package, or not so deep in one; import it by its whole name"
    parts = name.split(".")
    spec = _top_level_spec(parts[0])
    folders: Sequence[str] | None = None
    for number, last in enumerate(parts, start=1):
        full_name = ".".join(parts[:number])
        if number > 1:
            folders = _folders_of(full_name.rpartition(".")[0], spec)
            if folders is None:
                return ""
            spec = None if full_name in sys.modules else PathFinder.find_spec(full_name, folders)
        if spec is None and full_name not in sys.modules:
            return f"Python finds no '{full_name}'; {_what_to_do(last, folders, file)}"
    return ""


def _top_level_spec(name: str) -> ModuleSpec | None:
    try:
        return importlib.util.find_spec(name)
    except ValueError:  # it is loaded, but its origin is not known
        return ModuleSpec(name, None)


def _folders_of(package: str, spec: ModuleSpec | None) -> Sequence[str] | None:
    """Returns where the modules of a package are; None where only the package itself knows."""
    if package in sys.modules:
        return getattr(sys.modules[package], "__path__", None)
    if spec is None or spec.submodule_search_locations is None:
        return None
    if spec.origin is not None and _changes_import_path(Path(spec.origin)):
        return None
    return list(spec.submodule_search_locations)


def _changes_import_path(file: Path) -> bool:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return True
    return any(word in text for word in _PATH_CHANGES)


def _what_to_do(name: str, folders: Sequence[str] | None, file: Path) -> str:
    """Says how a module may be found; ``folders`` are those of its package, None for a module of its own."""
    beside = file.parent / name
    if folders is None and (beside.with_suffix(".py").is_file() or beside.is_dir()):
        return f"it is beside the state, where Python does not look; add {file.parent} to PYTHONPATH"
    known = sorted({item.name for item in pkgutil.iter_modules(folders)})
    return f"install it, or add the folder that has it to PYTHONPATH{nearest(name, known)}"
