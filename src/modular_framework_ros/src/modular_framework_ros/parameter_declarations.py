# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameter declarations of a node from `parameters/NODE.yaml` in its package.

The node reads its own file; launch checks read the file without importing the node.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import rospkg
import yaml

from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names

TYPES: dict[str, tuple[tuple[type, ...], str]] = {
    "str": ((str,), "a text"),
    "int": ((int,), "a whole number"),
    "float": ((int, float), "a number"),
    "bool": ((bool,), "true or false"),
    "list": ((list,), "a list"),
    "dict": ((dict,), "a mapping"),
    "any": ((object,), "any value"),
}
"""Python types of each declared type, and their description in messages."""


class DeclarationError(Exception):
    """A file of parameter declarations is missing or invalid; the message gives its path."""


@dataclass(frozen=True, slots=True)
class Declaration:
    """A declared parameter of a node.

    Attributes:
        name: `~name` for a private parameter, `name` in the node's namespace, `/name` for a global parameter.
        type: Key of TYPES.
        doc: Meaning and unit.
        default: Value if the parameter is not set; None without a default.
        required: Whether the parameter must be set to a non-empty value.
        required_with: Name of a parameter that makes this parameter required if its value is not empty.
        at_least, at_most: Inclusive bounds of a number.
        above: Exclusive lower bound of a number.
        choices: Allowed values; empty if any value is allowed.
        distinct: Whether the items of a list must be distinct.
        length: Required length of a list; None for any length.
        items: Type of each item of a list or mapping, a key of TYPES; empty for any type.
        names: Kind of object that the value names, such as `planner` or `group`; empty for other values.
        adjustable: Minimum and maximum for dynamic_reconfigure at run time; empty if fixed.
        tree: Whether the parameter is a namespace whose keys depend on the robot or a plugin.
        below: PACKAGE/NAME of the declarations in this namespace, with the placeholders `{joint}`, `{link}` and
            `{group}` for names of the robot; empty to allow all keys.
        effect: Whether the value changes what the node does. Two levels of an experiment that differ only in parameters
            without effect run the same.
    """

    name: str
    type: str
    doc: str
    default: Any = None
    required: bool = False
    required_with: str = ""
    at_least: float = -math.inf
    at_most: float = math.inf
    above: float = -math.inf
    choices: tuple[Any, ...] = ()
    distinct: bool = False
    length: int | None = None
    items: str = ""
    names: str = ""
    adjustable: tuple[Any, ...] = ()
    tree: bool = False
    below: str = ""
    effect: bool = True

    @property
    def allowed_values(self) -> str:
        """Description of the allowed values."""
        if self.choices:
            return ", ".join(map(str, self.choices))
        bounds = [
            f"{word} {bound:.12g}"
            for word, bound in (("above", self.above), ("at least", self.at_least), ("at most", self.at_most))
            if math.isfinite(bound)
        ]
        words = TYPES[self.type][1] + (f" of {self.length}" if self.length else "")
        if self.required and self.type in ("str", "list"):
            words += " that is not empty"
        if self.items:
            words += f", each {TYPES[self.items][1]}{' and listed once' if self.distinct else ''}"
        return ", ".join([words, " and ".join(bounds)] if bounds else [words])

    @property
    def requirement(self) -> str:
        """Allowed values and meaning, as text for messages."""
        return f"allowed: {self.allowed_values} ({self.doc.rstrip('.')})"

    def apply_required_with(self, get: Callable[[str], Any]) -> Declaration:
        """Returns the declaration with `required_with` applied to the values of the other parameters.

        Args:
            get: Function that returns the value of a parameter by its declared name, None if it is not set.
        """
        return replace(self, required=True) if self.required_with and get(self.required_with) else self

    def fault(self, value: Any) -> str:
        """Returns the error message of a value, without the parameter name; "" for a valid value."""
        fits = _is_of(self.type, value)
        if fits and self.items:
            items = value.values() if isinstance(value, dict) else value
            fits = all(_is_of(self.items, item) and self._is_within(item) and item != "" for item in items)
            fits = fits and not (self.distinct and len(set(items)) < len(items)) and self.length in (None, len(items))
        fits = fits and self._is_within(value) and not (self.required and value in ("", []))
        if fits and (not self.choices or value in self.choices):
            return ""
        return f"is {value!r}; {self.requirement}"

    def _is_within(self, value: Any) -> bool:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return True
        return self.at_least <= value <= self.at_most and value > self.above and math.isfinite(value)


def _is_of(type_name: str, value: Any) -> bool:
    """Returns whether a value has a declared type; booleans are not numbers."""
    kinds = TYPES[type_name][0]
    return isinstance(value, kinds) and (object in kinds or isinstance(value, bool) == (bool in kinds))


@dataclass(frozen=True, slots=True)
class NodeDeclaration:
    """The declared parameters of a node.

    Attributes:
        parameters: Declarations by the name in the file.
        closed: Whether an undeclared private parameter is an error. False for nodes with plugins whose parameters are
            not declared; there, only a name that differs slightly from a declared name is an error.
    """

    parameters: Mapping[str, Declaration] = field(default_factory=dict)
    closed: bool = True


class ParameterReader:
    """Reads declared parameters and rejects values that the declaration does not allow.

    Args:
        declaration: Declaration of the parameters.
        get: Function that returns the value of a parameter by its declared name, None if it is not set.
        whole_name: Function that returns the absolute name for messages.
    """

    def __init__(
        self, declaration: NodeDeclaration, get: Callable[[str], Any], whole_name: Callable[[str], str] = str
    ) -> None:
        self._declared, self._get, self._whole_name = declaration.parameters, get, whole_name

    def declarations(self) -> Iterable[Declaration]:
        """Returns the declarations of all parameters."""
        return self._declared.values()

    def declaration(self, name: str) -> Declaration:
        """Returns the declaration of a parameter."""
        return self._declared[name]

    def value(self, name: str) -> Any:
        """Returns the value of a parameter, or its default; integers become floats if the declared type is float.

        Args:
            name: Declared name, with `~` for a private parameter.

        Raises:
            ParameterError: The parameter is required and not set, or its value is not allowed.
            KeyError: The parameter is not declared.
        """
        return self.values(name)[0]

    def all(self) -> dict[str, Any]:
        """Returns the values of all declared parameters by name, as `value` does."""
        return dict(zip(self._declared, self.values(*self._declared), strict=True))

    def values(self, *names: str, required: Container[str] = ()) -> list[Any]:
        """Returns the values of several parameters, as `value` does.

        Args:
            names: Declared names.
            required: Names that are required in addition to the declaration.

        Raises:
            ParameterError: A value is missing or not allowed; the message lists all of them.
            KeyError: A parameter is not declared.
        """
        found, faults = [], []
        for name in names:
            declared = self._declared[name].apply_required_with(self._get)
            declared = replace(declared, required=True) if name in required else declared
            value = self._get(declared.name)
            value = declared.default if value is None else value
            if value is None and declared.required:
                faults.append(f"parameter '{self._whole_name(declared.name)}' is not set; {declared.requirement}")
            elif value is not None and declared.fault(value):
                faults.append(f"parameter '{self._whole_name(declared.name)}' {declared.fault(value)}")
            found.append(float(value) if declared.type == "float" and not faults and value is not None else value)
        if faults:
            raise ParameterError("; ".join(faults))
        return found


def parameters_below(package: str, name: str, private_handle: NodeHandle, root_handle: NodeHandle) -> ParameterReader:
    """Returns a reader for the parameters of a plugin, such as hardware, that has its own declaration.

    Args:
        package: Package of the plugin.
        name: Name of the file in the folder `parameters`; for hardware its class.
        private_handle: Node handle for names that begin with `~`.
        root_handle: Node handle for all other names.

    Raises:
        DeclarationError: The declaration is missing or invalid.
    """

    def resolve(declared: str) -> tuple[NodeHandle, str]:
        return (private_handle, declared[1:]) if declared.startswith("~") else (root_handle, declared)

    def get(declared: str) -> Any:
        handle, key = resolve(declared)
        return handle.get_param(key)

    def whole_name(declared: str) -> str:
        handle, key = resolve(declared)
        return join_names(handle.namespace, key)

    return ParameterReader(existing_declaration(package, name), get, whole_name)


def existing_declaration(package: str, node: str) -> NodeDeclaration:
    """Returns the declared parameters of an executable or a plugin; raises DeclarationError if there are none."""
    declaration = node_declaration(package, node)
    if declaration is None:
        raise DeclarationError(f"there is no {package}/parameters/{node}.yaml")
    return declaration


@cache
def node_declaration(package: str, node: str) -> NodeDeclaration | None:
    """Returns the declared parameters of an executable; None if its package declares none.

    Raises:
        DeclarationError: The file is invalid.
    """
    try:
        path = Path(_packages().get_path(package)) / "parameters" / f"{node}.yaml"
    except rospkg.ResourceNotFound:
        return None
    return read_declaration(path) if path.is_file() else None


@cache
def _packages() -> rospkg.RosPack:
    """Returns the package index, cached because the search is slow."""
    return rospkg.RosPack()


def read_declaration(path: Path) -> NodeDeclaration:
    """Reads a file of parameter declarations.

    Keys of the file: `parameters` ({name: {type, doc, default, ...}}), `includes` (a list of PACKAGE/NODE whose
    parameters
    are included), `closed` (true or false).

    Raises:
        DeclarationError: The file is invalid.
    """
    try:
        content = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.CSafeLoader)
        parameters: dict[str, Declaration] = {}
        for included in content.get("includes", ()):
            found = node_declaration(*str(included).split("/"))
            if found is None:
                raise DeclarationError(f"includes {included}, which declares no parameters")
            parameters |= found.parameters
        for name, keys in (content.get("parameters") or {}).items():
            lists = {key: tuple(keys.pop(key, ())) for key in ("choices", "adjustable")}
            parameters[name] = Declaration(name=name, **lists, **keys)
            for word in filter(None, (parameters[name].type, parameters[name].items)):
                if word not in TYPES:
                    raise DeclarationError(f"{name}: type '{word}'; allowed: {', '.join(TYPES)}")
        return NodeDeclaration(parameters, bool(content.get("closed", True)))
    except (OSError, yaml.YAMLError, TypeError, ValueError, AttributeError, DeclarationError) as error:
        raise DeclarationError(f"{path}: {error}") from error
