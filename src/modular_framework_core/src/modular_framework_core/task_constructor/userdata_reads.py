# SPDX-License-Identifier: BSD-3-Clause
"""Finds which userdata keys a state's class reads, from its source, without running it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

_METHODS = ("keys", "update", "extract", "merge")
_ASKS_FIRST = ("get_registered_input_keys", "_input_keys")


@dataclass(frozen=True, slots=True)
class UserdataReads:
    """Keys that a class reads of what its methods call ``userdata``.

    Attributes:
        anywhere: Keys that are read somewhere, but for those that the class asks for by name (``"key" in userdata``).
        always: Keys that are read whenever ``execute`` runs from its start on: not below an ``if``, ``try``, loop or
            function, and in no class that asks first which keys there are.
    """

    anywhere: frozenset[str] = frozenset()
    always: frozenset[str] = frozenset()


def reads_of(node: ast.ClassDef) -> UserdataReads:
    """Returns what a class reads of userdata."""
    anywhere = frozenset(_keys(node)) - frozenset(_asked_for(node))
    execute = next((item for item in node.body if isinstance(item, ast.FunctionDef) and item.name == "execute"), None)
    if execute is None or any(_asks(item) for item in ast.walk(node)):
        return UserdataReads(anywhere)
    always: set[str] = set()
    for statement in execute.body:
        if not isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign | ast.Expr | ast.Return):
            break
        if any(
            isinstance(item, ast.IfExp | ast.BoolOp | ast.Lambda | ast.comprehension) for item in ast.walk(statement)
        ):
            break
        always.update(_keys(statement))
    return UserdataReads(anywhere, frozenset(always) - _written(execute))


def _keys(node: ast.AST) -> Iterator[str]:
    for item in ast.walk(node):
        match item:
            case ast.Attribute(value=ast.Name(id="userdata"), attr=key, ctx=ast.Load()) if key not in _METHODS:
                yield key
            case ast.Subscript(value=ast.Name(id="userdata"), slice=ast.Constant(value=str(key)), ctx=ast.Load()):
                yield key


def _written(node: ast.AST) -> set[str]:
    """Returns the keys a function writes: what it reads of them may be its own."""
    return {
        item.attr
        for item in ast.walk(node)
        if isinstance(item, ast.Attribute)
        and isinstance(item.ctx, ast.Store)
        and isinstance(item.value, ast.Name)
        and item.value.id == "userdata"
    }


def _asked_for(node: ast.AST) -> Iterator[str]:
    """Yields the keys of which a class asks by name whether they are there."""
    for item in ast.walk(node):
        match item:
            case ast.Compare(left=ast.Constant(value=str(key))) if any(_asks(part) for part in ast.walk(item)):
                yield key


def _asks(node: ast.AST) -> bool:
    match node:
        case ast.Attribute(attr=name) if name in _ASKS_FIRST:
            return True
        case ast.Compare(ops=[ast.In() | ast.NotIn()], comparators=[ast.Name(id="userdata")]):
            return True
    return False
