# SPDX-License-Identifier: BSD-3-Clause
"""Reads which parameters a node has: one file `parameters/NODE.yaml` in its package, which the node itself reads.

Programs that check a launch before it starts read the same file, without importing the node.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import rospkg
import yaml

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
        at_least, at_most: Bounds of a number, themselves allowed.
        above: Lower bound that is itself not allowed.
        choices: Allowed values; empty: any.
        names: Kind of thing it names, such as `planner` or `group`; empty: none.
        tree: Whether there are names below this one that only the robot or a plugin knows.
    """

    name: str
    type: str
    doc: str
    default: Any = None
    required: bool = False
    at_least: float = -math.inf
    at_most: float = math.inf
    above: float = -math.inf
    choices: tuple[Any, ...] = ()
    names: str = ""
    tree: bool = False

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
        if not bounds:
            return TYPES[self.type][1] + (" that is not empty" if self.required and self.type == "str" else "")
        return f"{TYPES[self.type][1]}, {' and '.join(bounds)}"

    def fault(self, value: Any) -> str:
        """Returns what is wrong with a value, in words that follow the name of the parameter; "" if nothing is."""
        kinds = TYPES[self.type][0]
        fits = isinstance(value, kinds) and (object in kinds or isinstance(value, bool) == (bool in kinds))
        if fits and isinstance(value, int | float) and not isinstance(value, bool):
            fits = self.at_least <= value <= self.at_most and value > self.above and math.isfinite(value)
        if self.choices:
            fits = fits and value in self.choices
        if fits and not (self.required and value == ""):
            return ""
        return f"is {value!r}; allowed: {self.allowed}"


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


@cache
def node_declaration(package: str, node: str) -> NodeDeclaration | None:
    """Returns the declared parameters of an executable of a package; None if it declares none.

    Raises:
        DeclarationError: The file cannot be used.
    """
    try:
        path = Path(rospkg.RosPack().get_path(package)) / "parameters" / f"{node}.yaml"
    except rospkg.ResourceNotFound:
        return None
    return read_declaration(path) if path.is_file() else None


def read_declaration(path: Path) -> NodeDeclaration:
    """Reads a file of declarations.

    Its keys: `parameters` ({name: {type, doc, default, ...}}), `includes` (a list of PACKAGE/NODE whose parameters
    the node has too), `closed` (true or false).

    Raises:
        DeclarationError: It cannot be used.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        parameters: dict[str, Declaration] = {}
        for included in content.get("includes", ()):
            found = node_declaration(*str(included).split("/"))
            if found is None:
                raise DeclarationError(f"includes {included}, which declares no parameters")
            parameters |= found.parameters
        for name, keys in (content.get("parameters") or {}).items():
            choices = tuple(keys.pop("choices", ()))
            parameters[name] = Declaration(name=name, choices=choices, **keys)
            if parameters[name].type not in TYPES:
                raise DeclarationError(f"{name}: type '{parameters[name].type}'; allowed: {', '.join(TYPES)}")
        return NodeDeclaration(parameters, bool(content.get("closed", True)))
    except (OSError, yaml.YAMLError, TypeError, ValueError, AttributeError, DeclarationError) as error:
        raise DeclarationError(f"{path}: {error}") from error
