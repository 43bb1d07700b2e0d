# SPDX-License-Identifier: BSD-3-Clause
"""Classes of states and the bases they are derived from, read from their source without running any of it.

A base may be in the file of the state, or in a module of the state's own package or of the framework that the file
imports it from by name; other bases are not known.
"""

from __future__ import annotations

import ast
import functools
from dataclasses import dataclass
from pathlib import Path

_FRAMEWORK = Path(__file__).resolve().parents[2]

BASE_DEFAULTS: dict[str, tuple[str, ...]] = {
    "FrameworkState": ("success", "fail"),
    "State": (),
}
"""Default outcomes of the base classes a state may leave its constructor to."""
_ARGS = "\n\nArgs:\n"


class StateSourceError(Exception):
    """A state file is not usable as a state; the message says why."""


class SourceModule:
    """A Python file.

    Args:
        file: The file.

    Raises:
        StateSourceError: It cannot be read as Python.

    Attributes:
        tree: What it says.
        classes: The classes it defines, by name.
        assignments: What its plain assignments assign, by name.
    """

    def __init__(self, file: Path) -> None:
        try:
            self.tree = ast.parse(file.read_text(encoding="utf-8"), filename=str(file))
        except (OSError, SyntaxError, ValueError) as error:
            raise StateSourceError(f"{file} cannot be read as Python: {error}") from error
        self.classes = {node.name: node for node in self.tree.body if isinstance(node, ast.ClassDef)}
        self.assignments = {
            node.targets[0].id: node.value
            for node in self.tree.body
            if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name)
        }
        self._imports = _imports(self.tree, file)

    @functools.cached_property
    def aliases(self) -> dict[str, ast.expr]:
        """Its plain assignments, and those that it imports by name: the names a type may have been given."""
        imported = {
            name: _module(source).assignments[there]
            for name, (source, there) in self._imports.items()
            if there in _module(source).assignments
        }
        return imported | self.assignments

    def find(self, name: str) -> SourceClass | None:
        """Returns a class that the file defines, or imports from where it is defined; None when it is not known."""
        if name in self.classes:
            return SourceClass(self.classes[name], self)
        if name not in self._imports or name in BASE_DEFAULTS:
            return None
        source, there = self._imports[name]
        module = _module(source)
        return SourceClass(module.classes[there], module) if there in module.classes else None


@dataclass(frozen=True, slots=True, eq=False)
class SourceClass:
    """A class and the module that defines it."""

    node: ast.ClassDef
    module: SourceModule

    @property
    def base_names(self) -> list[str]:
        """Names of its bases, without their modules."""
        return [base.attr if isinstance(base, ast.Attribute) else getattr(base, "id", "") for base in self.node.bases]

    @property
    def bases(self) -> list[SourceClass]:
        """Those of its bases that are known."""
        return [base for base in map(self.base, self.base_names) if base is not None]

    def base(self, name: str) -> SourceClass | None:
        """Returns its base of a name; None when that is not known."""
        return None if name == self.node.name else self.module.find(name)

    @property
    def constructor(self) -> ast.FunctionDef | None:
        """Its own constructor."""
        functions = (each for each in self.node.body if isinstance(each, ast.FunctionDef))
        return next((each for each in functions if each.name == "__init__"), None)

    @property
    def is_framework_state(self) -> bool:
        """Whether it is derived from ``FrameworkState``."""
        return "FrameworkState" in self.base_names or any(base.is_framework_state for base in self.bases)

    @property
    def doc(self) -> str:
        """Its docstring; without a constructor of its own, with the arguments of its base's."""
        own = ast.get_docstring(self.node) or ""
        if self.constructor is not None or not self.bases or _ARGS in own:
            return own
        return own + "".join(self.bases[0].doc.partition(_ARGS)[1:])


def _imports(tree: ast.Module, file: Path) -> dict[str, tuple[Path, str]]:
    """Returns, by name, the files of the own package or the framework that names are imported from, and those there."""
    own = next(folder for folder in file.parents if not (folder / "__init__.py").is_file())
    found: dict[str, tuple[Path, str]] = {}
    for node in tree.body:
        if not isinstance(node, ast.ImportFrom) or node.level or not node.module:
            continue
        sources = [root.joinpath(*node.module.split(".")).with_suffix(".py") for root in (own, _FRAMEWORK)]
        source = next((source for source in sources if source.is_file()), None)
        if source is not None:
            found |= {item.asname or item.name: (source, item.name) for item in node.names}
    return found


def _module(file: Path) -> SourceModule:
    return _module_as_of(file, file.stat().st_mtime_ns)


@functools.lru_cache(maxsize=1000)
def _module_as_of(file: Path, changed_ns: int) -> SourceModule:
    return SourceModule(file)
