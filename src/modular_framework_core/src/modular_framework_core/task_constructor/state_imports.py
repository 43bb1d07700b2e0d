# SPDX-License-Identifier: BSD-3-Clause
"""Checks that Python finds the modules that a state file imports, without importing them."""

from __future__ import annotations

import ast
import importlib.util
import pkgutil
import sys
from collections.abc import Iterator, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from modular_framework_ros.allowed_names import nearest

_PATH_CHANGES = ("sys.path", "sys.modules", "sys.meta_path", "addsitedir", "__path__")
"""Words in a file that suggest a changed import path at run time."""


def missing_imports(tree: ast.Module, file: Path) -> tuple[str, ...]:
    """Returns a message for each module that a file imports and Python does not find.

    Only unconditional imports at the top level are checked, and only modules, not names within modules. A file that
    changes the import path is not checked.

    Args:
        tree: Syntax tree of the file.
        file: Absolute path of the file.

    Returns:
        One message per failing import, beginning with file and line.
    """
    if _changes_import_path(file):
        return ()
    messages: list[str] = []
    for line, name in _top_imports(tree, file):
        fault = _import_fault(name, file)
        if fault:
            messages.append(f"{file}:{line} imports '{name}', but {fault}")
    return tuple(messages)


def _top_imports(tree: ast.Module, file: Path) -> Iterator[tuple[int, str]]:
    """Yields line and module of each import. Relative names are resolved if the file is in a package."""
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


def _import_fault(name: str, file: Path) -> str:
    """Returns the missing part of a module's name and a remedy, or "" if the module may exist."""
    if name.startswith("."):
        return f"{file.parent} is not nested deeply enough in a package; import it by its full name"
    parts = name.split(".")
    spec = _top_level_spec(parts[0])
    folders: Sequence[str] | None = None
    for depth, last in enumerate(parts, start=1):
        full_name = ".".join(parts[:depth])
        if depth > 1:
            folders = _folders_of(full_name.rpartition(".")[0], spec)
            if folders is None:
                return ""
            spec = None if full_name in sys.modules else PathFinder.find_spec(full_name, folders)
        if spec is None and full_name not in sys.modules:
            return f"Python finds no '{full_name}'; {_remedy(last, folders, file)}"
    return ""


def _top_level_spec(name: str) -> ModuleSpec | None:
    try:
        return importlib.util.find_spec(name)
    except ValueError:  # the module is loaded, but its origin is unknown
        return ModuleSpec(name, None)


def _folders_of(package: str, spec: ModuleSpec | None) -> Sequence[str] | None:
    """Returns the folders of a package's modules, or None if they are known only after an import."""
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


def _remedy(name: str, folders: Sequence[str] | None, file: Path) -> str:
    """Returns advice for a missing module.

    Args:
        name: Last part of the module's name.
        folders: Folders of the module's package; None for a top-level module.
        file: State file that imports the module.
    """
    sibling = file.parent / name
    if folders is None and (sibling.with_suffix(".py").is_file() or sibling.is_dir()):
        return f"it is beside the state, where Python does not look; add {file.parent} to PYTHONPATH"
    known_modules = sorted({item.name for item in pkgutil.iter_modules(folders)})
    return f"install it, or add its folder to PYTHONPATH{nearest(name, known_modules)}"
