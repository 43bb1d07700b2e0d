# SPDX-License-Identifier: BSD-3-Clause
"""Reads from the source the outcomes and userdata keys that a state's constructor fixes.

A framework state takes ``outcomes``, ``input_keys``, ``output_keys`` and ``io_keys`` as options and passes them on
unchanged, most simply as ``**keys: Unpack[StateKeys]``. A plain smach state fixes them::

    def __init__(self):
        smach.State.__init__(self, outcomes=["opened", "stuck"], input_keys=["door"])
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from typing import TypedDict


class StateKeys(TypedDict, total=False):
    """Options of every framework state, in the order of smach's constructor."""

    outcomes: Sequence[str]
    input_keys: Sequence[str]
    output_keys: Sequence[str]
    io_keys: Sequence[str]


STATE_KEYS = tuple(StateKeys.__annotations__)
KEY_MEANINGS = {
    "outcomes": "The first is positive, the last negative.",
    "input_keys": "Userdata keys that the state reads.",
    "output_keys": "Userdata keys that the state writes.",
    "io_keys": "Userdata keys that the state reads and writes.",
}

_KEY_OF_REGISTER_METHOD = {f"register_{key}": key for key in STATE_KEYS}
_COPYING_FUNCTIONS = ("list", "tuple")

Names = tuple[str, ...] | None


def own_keys(constructor: ast.FunctionDef, has_smach_base: bool, aliases: Mapping[str, ast.expr]) -> dict[str, Names]:
    """Returns the outcomes and userdata keys that a constructor fixes.

    Args:
        constructor: Syntax tree of the constructor.
        has_smach_base: Whether the base class is ``smach.State`` or ``FrameworkState``, with known argument order.
        aliases: Assignments of the module, name -> value.

    Returns:
        Fixed names for each key of ``STATE_KEYS``, None if unknown. Keys set by the option of the same name are absent.
    """
    calls = [
        item
        for item in ast.walk(constructor)
        if isinstance(item, ast.Call) and isinstance(item.func, ast.Attribute) and item.func.attr == "__init__"
    ]
    options = {argument.arg for argument in (*constructor.args.args, *constructor.args.kwonlyargs)}
    keys_name = keys_argument(constructor)
    uses = sum(isinstance(item, ast.Name) and item.id == keys_name for item in ast.walk(constructor))
    fixed: dict[str, Names] = {}
    if len(calls) > 1 or uses > 1:
        fixed = dict.fromkeys(STATE_KEYS)
    elif calls:
        base_arguments, rest_unknown = _base_arguments(calls[0], has_smach_base, keys_name)
        for key in STATE_KEYS:
            if key in base_arguments and not _is_option(base_arguments[key], key):
                fixed[key] = _names(base_arguments[key], aliases)
            elif key not in base_arguments and (rest_unknown or key in options):
                fixed[key] = None
    return fixed | dict.fromkeys(_changed_keys(constructor))


def keys_argument(constructor: ast.FunctionDef) -> str | None:
    """Returns the name of a constructor's argument ``**keys: Unpack[StateKeys]``, or None."""
    match constructor.args.kwarg:
        case ast.arg(arg=name, annotation=ast.Subscript(value=ast.Name("Unpack"), slice=ast.Name("StateKeys"))):
            return name
    return None


def _base_arguments(call: ast.Call, has_smach_base: bool, keys_name: str | None) -> tuple[dict[str, ast.expr], bool]:
    """Returns the arguments of a call of the base constructor, and whether there may be unknown arguments."""
    is_super = isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Call)
    positional = call.args if is_super else call.args[1:]
    base_arguments = {str(item.arg): item.value for item in call.keywords if item.arg is not None}
    mappings = [item.value for item in call.keywords if not item.arg]
    starred = any(isinstance(item, ast.Starred) for item in positional) or any(
        not (isinstance(value, ast.Name) and value.id == keys_name) for value in mappings
    )
    if has_smach_base and not starred:
        base_arguments.update(zip(STATE_KEYS, positional, strict=False))
    return base_arguments, starred or not has_smach_base


def _is_option(value: ast.expr, key: str) -> bool:
    match value:
        case ast.Name(id=name):
            return name == key
        case ast.Call(func=ast.Name(id=name), args=[ast.Name(id=inner)]) if name in _COPYING_FUNCTIONS:
            return inner == key
    return False


def _names(value: ast.expr, aliases: Mapping[str, ast.expr]) -> Names:
    try:
        plain = ast.literal_eval(aliases.get(value.id, value) if isinstance(value, ast.Name) else value)
    except (ValueError, TypeError, SyntaxError):
        return None
    is_list = isinstance(plain, list | tuple) and all(isinstance(name, str) for name in plain)
    return tuple(plain) if is_list else None


def _changed_keys(constructor: ast.FunctionDef) -> Iterator[str]:
    """Yields the keys whose option the constructor changes, or to which the constructor adds names."""
    for item in ast.walk(constructor):
        match item:
            case ast.Name(id=name, ctx=ast.Store()) if name in STATE_KEYS:
                yield name
            case ast.Attribute(value=ast.Name(id=name)) if name in STATE_KEYS:
                yield name
            case ast.Attribute(attr=name) if name in _KEY_OF_REGISTER_METHOD:
                yield _KEY_OF_REGISTER_METHOD[name]
