# SPDX-License-Identifier: BSD-3-Clause
"""Reads state classes and their base classes from the source, without running the source.

Known base classes are defined in the state's file, or imported by name from the state's own package or the framework.
"""

from __future__ import annotations

import ast
import functools
from dataclasses import dataclass
from pathlib import Path

_FRAMEWORK_CLASS = Path(__file__).resolve().parents[2]

BASE_DEFAULTS: dict[str, tuple[str, ...]] = {
    "FrameworkState": ("success", "fail"),
    "State": (),
}
"""Default outcomes of base classes whose constructor a state may inherit."""
_ARGS = "\n\nArgs:\n"


class StateSourceError(Exception):
    """A state file is not usable as a state; the message says why."""


class SourceModule:
    """A parsed Python file.

    Args:
        file: Path of the file.

    Raises:
        StateSourceError: The file cannot be read or is not valid Python.

    Attributes:
        tree: Syntax tree.
        classes: Classes defined in the file, by name.
        assignments: Values of plain assignments, by name.
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
        """Plain assignments of the file and those imported by name, which may be type aliases."""
        imported = {
            name: _module(source).assignments[original_name]
            for name, (source, original_name) in self._imports.items()
            if original_name in _module(source).assignments
        }
        return imported | self.assignments

    def find(self, name: str) -> SourceClass | None:
        """Returns a class that the file defines or imports from its defining module; None if unknown."""
        if name in self.classes:
            return SourceClass(self.classes[name], self)
        if name not in self._imports or name in BASE_DEFAULTS:
            return None
        source, original_name = self._imports[name]
        module = _module(source)
        return SourceClass(module.classes[original_name], module) if original_name in module.classes else None


@dataclass(frozen=True, slots=True, eq=False)
class SourceClass:
    """A class and its module."""

    node: ast.ClassDef
    module: SourceModule

    @property
    def base_names(self) -> list[str]:
        """Names of the base classes without their modules."""
        return [base.attr if isinstance(base, ast.Attribute) else getattr(base, "id", "") for base in self.node.bases]

    @property
    def bases(self) -> list[SourceClass]:
        """Known base classes."""
        return [base for base in map(self.base, self.base_names) if base is not None]

    def base(self, name: str) -> SourceClass | None:
        """Returns the base class of a name, or None if unknown."""
        return None if name == self.node.name else self.module.find(name)

    @property
    def constructor(self) -> ast.FunctionDef | None:
        """The class's own constructor, or None if inherited."""
        functions = (item for item in self.node.body if isinstance(item, ast.FunctionDef))
        return next((item for item in functions if item.name == "__init__"), None)

    @property
    def is_framework_state(self) -> bool:
        """Whether the class derives from ``FrameworkState``."""
        return "FrameworkState" in self.base_names or any(base.is_framework_state for base in self.bases)

    @property
    def doc(self) -> str:
        """Docstring of the class. If the constructor is inherited, the base's Args section is appended."""
        own_root = ast.get_docstring(self.node) or ""
        if self.constructor is not None or not self.bases or _ARGS in own_root:
            return own_root
        return own_root + "".join(self.bases[0].doc.partition(_ARGS)[1:])


def _imports(tree: ast.Module, file: Path) -> dict[str, tuple[Path, str]]:
    """Returns the names imported from the file's own package or the framework, as name -> (file, original name)."""
    own_root = next(folder for folder in file.parents if not (folder / "__init__.py").is_file())
    imports: dict[str, tuple[Path, str]] = {}
    for node in tree.body:
        if not isinstance(node, ast.ImportFrom) or node.level or not node.module:
            continue
        sources = [root.joinpath(*node.module.split(".")).with_suffix(".py") for root in (own_root, _FRAMEWORK_CLASS)]
        source = next((source for source in sources if source.is_file()), None)
        if source is not None:
            imports |= {item.asname or item.name: (source, item.name) for item in node.names}
    return imports


def _module(file: Path) -> SourceModule:
    return _module_as_of(file, file.stat().st_mtime_ns)


@functools.lru_cache(maxsize=1000)
def _module_as_of(file: Path, changed_ns: int) -> SourceModule:
    return SourceModule(file)
