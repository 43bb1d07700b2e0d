# SPDX-License-Identifier: BSD-3-Clause
"""Reads which parameters a node has: one file `parameters/NODE.yaml` in its package, which the node itself reads.

Programs that check a launch before it starts read the same file, without importing the node.
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
"""Python types of each type word, and the words for it in a message."""


class DeclarationError(Exception):
    """A file that declares parameters cannot be used; the message names it."""


@dataclass(frozen=True, slots=True)
class Declaration:
    """One parameter of a node.

    Attributes:
        name: `~name` below the node, `name` in the node's namespace, `/name` everywhere.
        type: A word of TYPES.
        doc: Meaning and unit.
        default: Value if it is not set; None: none.
        required: Whether it must be set, and not to an empty text.
        required_with: Parameter with which it is required, unless that is empty.
        at_least, at_most: Bounds of a number, themselves allowed.
        above: Lower bound that is itself not allowed.
        choices: Allowed values; empty: any.
        distinct: Whether no item of a list may come twice.
        length: Number of items of a list; None: any.
        items: Type of each item of a list or mapping, a word of TYPES; empty: any.
        names: Kind of thing it names, such as `planner` or `group`; empty: none.
        adjustable: Lowest and highest value that dynamic_reconfigure may give it while the node runs; empty: none.
        tree: Whether there are names below this one that only the robot or a plugin knows.
        below: PACKAGE/NAME of the declaration of these names, in which `{joint}`, `{link}` and `{group}` stand for
            names of the robot; empty: any are allowed.
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

    @property
    def allowed(self) -> str:
        """The values that are allowed, in words."""
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
    def needed(self) -> str:
        """What a required parameter must be set to, in words."""
        return f"allowed: {self.allowed} ({self.doc.rstrip('.')})"

    def beside(self, get: Callable[[str], Any]) -> Declaration:
        """Returns the declaration beside the values of the other parameters.

        Args:
            get: Returns the value of a parameter by its declared name, None if it is not set.
        """
        return replace(self, required=True) if self.required_with and get(self.required_with) else self

    def fault(self, value: Any) -> str:
        """Returns what is wrong with a value, in words that follow the name of the parameter; "" if nothing is."""
        fits = _is_of(self.type, value)
        if fits and self.items:
            items = value.values() if isinstance(value, dict) else value
            fits = all(_is_of(self.items, item) and self._is_within(item) and item != "" for item in items)
            fits = fits and not (self.distinct and len(set(items)) < len(items)) and self.length in (None, len(items))
        fits = fits and self._is_within(value) and not (self.required and value in ("", []))
        if fits and (not self.choices or value in self.choices):
            return ""
        return f"is {value!r}; {self.needed}"

    def _is_within(self, value: Any) -> bool:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return True
        return self.at_least <= value <= self.at_most and value > self.above and math.isfinite(value)


def _is_of(word: str, value: Any) -> bool:
    """Returns whether a value is of a type by its word; true and false are no numbers."""
    kinds = TYPES[word][0]
    return isinstance(value, kinds) and (object in kinds or isinstance(value, bool) == (bool in kinds))


@dataclass(frozen=True, slots=True)
class NodeDeclaration:
    """The parameters of a node.

    Attributes:
        parameters: By the name that the file gives them.
        closed: Whether the node has no other parameters of its own, so that a name below it that is not declared is
            misspelt. Open are nodes that read what configuration packages of others have.
    """

    parameters: Mapping[str, Declaration] = field(default_factory=dict)
    closed: bool = True


class ParameterReader:
    """Reads declared parameters; a value that the declaration does not allow is refused.

    Args:
        declaration: The parameters.
        get: Returns the value of a parameter by its declared name, None if it is not set.
        whole_name: Returns the name for messages.
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
        """Returns a parameter, a number of type float as a float; its default if it is not set.

        Args:
            name: As it is declared, with `~` for the node's own.

        Raises:
            ParameterError: It is required and not set, or its value is not allowed.
            KeyError: It is not declared.
        """
        return self.values(name)[0]

    def all(self) -> dict[str, Any]:
        """Returns all declared parameters by name, as `values` does."""
        return dict(zip(self._declared, self.values(*self._declared), strict=True))

    def values(self, *names: str, required: Container[str] = ()) -> list[Any]:
        """Returns several parameters, as `value` does.

        Args:
            names: As they are declared.
            required: Names of those that are required though the declaration does not say so.

        Raises:
            ParameterError: Names each that is not set though required, or whose value is not allowed.
            KeyError: One is not declared.
        """
        found, faults = [], []
        for name in names:
            declared = self._declared[name].beside(self._get)
            declared = replace(declared, required=True) if name in required else declared
            value = self._get(declared.name)
            value = declared.default if value is None else value
            if value is None and declared.required:
                faults.append(f"parameter '{self._whole_name(declared.name)}' is not set; {declared.needed}")
            elif value is not None and declared.fault(value):
                faults.append(f"parameter '{self._whole_name(declared.name)}' {declared.fault(value)}")
            found.append(float(value) if declared.type == "float" and not faults and value is not None else value)
        if faults:
            raise ParameterError("; ".join(faults))
        return found


def parameters_below(package: str, name: str, own: NodeHandle, root: NodeHandle) -> ParameterReader:
    """Returns the parameters of a part of a node, such as hardware, which has a declaration of its own.

    Args:
        package: Package of the part.
        name: Name of the file in its folder `parameters`; that of hardware is its class.
        own: Namespace of the names that begin with `~`.
        root: Namespace of the others.

    Raises:
        DeclarationError: There is no declaration of it, or it cannot be used.
    """

    def place(declared: str) -> tuple[NodeHandle, str]:
        return (own, declared[1:]) if declared.startswith("~") else (root, declared)

    def get(declared: str) -> Any:
        handle, key = place(declared)
        return handle.get_param(key)

    def whole_name(declared: str) -> str:
        handle, key = place(declared)
        return join_names(handle.namespace, key)

    return ParameterReader(existing_declaration(package, name), get, whole_name)


def existing_declaration(package: str, node: str) -> NodeDeclaration:
    """Returns the declared parameters of an executable or a part; raises DeclarationError if there are none."""
    found = node_declaration(package, node)
    if found is None:
        raise DeclarationError(f"there is no {package}/parameters/{node}.yaml")
    return found


@cache
def node_declaration(package: str, node: str) -> NodeDeclaration | None:
    """Returns the declared parameters of an executable of a package; None if it declares none.

    Raises:
        DeclarationError: The file cannot be used.
    """
    try:
        path = Path(_packages().get_path(package)) / "parameters" / f"{node}.yaml"
    except rospkg.ResourceNotFound:
        return None
    return read_declaration(path) if path.is_file() else None


@cache
def _packages() -> rospkg.RosPack:
    """Returns the packages; looking for them takes long."""
    return rospkg.RosPack()


def read_declaration(path: Path) -> NodeDeclaration:
    """Reads a file of declarations.

    Its keys: `parameters` ({name: {type, doc, default, ...}}), `includes` (a list of PACKAGE/NODE whose parameters
    the node has too), `closed` (true or false).

    Raises:
        DeclarationError: It cannot be used.
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
