# SPDX-License-Identifier: BSD-3-Clause
"""Finds the userdata keys that a state class reads, from its source, without running the source."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

_METHODS = ("keys", "update", "extract", "merge")
_REGISTERED_KEYS = ("get_registered_input_keys", "_input_keys")


@dataclass(frozen=True, slots=True)
class UserdataReads:
    """Userdata keys that the methods of a class read.

    Attributes:
        anywhere: Keys read in any method, except keys tested by name (``"key" in userdata``).
        always: Keys that every run of ``execute`` reads: outside of any ``if``, ``try``, loop or inner function. Empty
            for classes that test which keys exist.
    """

    anywhere: frozenset[str] = frozenset()
    always: frozenset[str] = frozenset()


def reads_of(node: ast.ClassDef) -> UserdataReads:
    """Returns the userdata keys that a class reads."""
    anywhere = frozenset(_keys(node)) - frozenset(_tested_keys(node))
    execute = next((item for item in node.body if isinstance(item, ast.FunctionDef) and item.name == "execute"), None)
    if execute is None or any(_tests_keys(item) for item in ast.walk(node)):
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
    """Returns the keys that a function writes; the function may read its own values of these keys."""
    return {
        item.attr
        for item in ast.walk(node)
        if isinstance(item, ast.Attribute)
        and isinstance(item.ctx, ast.Store)
        and isinstance(item.value, ast.Name)
        and item.value.id == "userdata"
    }


def _tested_keys(node: ast.AST) -> Iterator[str]:
    """Yields the keys whose presence a class tests by name."""
    for item in ast.walk(node):
        match item:
            case ast.Compare(left=ast.Constant(value=str(key))) if any(_tests_keys(part) for part in ast.walk(item)):
                yield key


def _tests_keys(node: ast.AST) -> bool:
    match node:
        case ast.Attribute(attr=name) if name in _REGISTERED_KEYS:
            return True
        case ast.Compare(ops=[ast.In() | ast.NotIn()], comparators=[ast.Name(id="userdata")]):
            return True
    return False
