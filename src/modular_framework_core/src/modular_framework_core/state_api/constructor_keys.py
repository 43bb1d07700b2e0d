# SPDX-License-Identifier: BSD-3-Clause
"""Reads from a state's constructor the outcomes and userdata keys that it declares itself, apart from its options.

A state of the framework has options named ``outcomes``, ``input_keys``, ``output_keys`` and ``io_keys``, and passes
them on as they are, most simply as ``**keys: Unpack[StateKeys]``. The usual smach state declares its own::

    def __init__(self):
        smach.State.__init__(self, outcomes=["opened", "stuck"], input_keys=["door"])
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from typing import TypedDict


class StateKeys(TypedDict, total=False):
    """Options every state of the framework has, in the order of smach's constructor."""

    outcomes: Sequence[str]
    input_keys: Sequence[str]
    output_keys: Sequence[str]
    io_keys: Sequence[str]


STATE_KEYS = tuple(StateKeys.__annotations__)
KEY_MEANINGS = {
    "outcomes": "First positive, last negative.",
    "input_keys": "Userdata that is read.",
    "output_keys": "Userdata that is written.",
    "io_keys": "Userdata that is read and written.",
}

_REGISTERS = {f"register_{key}": key for key in STATE_KEYS}
_COPIES = ("list", "tuple")

Names = tuple[str, ...] | None


def own_keys(constructor: ast.FunctionDef, of_smach: bool, aliases: Mapping[str, ast.expr]) -> dict[str, Names]:
    """Returns what a constructor declares by itself.

    Args:
        constructor: The constructor.
        of_smach: Whether its base is ``smach.State`` or ``FrameworkState``, whose order of arguments is known.
        aliases: Assignments of the module, name -> value.

    Returns:
        By key of ``STATE_KEYS``: the names; None when they cannot be known. A key is left out when the option of that
        name decides.
    """
    calls = [
        item
        for item in ast.walk(constructor)
        if isinstance(item, ast.Call) and isinstance(item.func, ast.Attribute) and item.func.attr == "__init__"
    ]
    options = {argument.arg for argument in (*constructor.args.args, *constructor.args.kwonlyargs)}
    passed_on = keys_argument(constructor)
    uses = sum(isinstance(item, ast.Name) and item.id == passed_on for item in ast.walk(constructor))
    found: dict[str, Names] = {}
    if len(calls) > 1 or uses > 1:
        found = dict.fromkeys(STATE_KEYS)
    elif calls:
        given, rest_unknown = _given(calls[0], of_smach, passed_on)
        for key in STATE_KEYS:
            if key in given and not _is_option(given[key], key):
                found[key] = _names(given[key], aliases)
            elif key not in given and (rest_unknown or key in options):
                found[key] = None
    return found | dict.fromkeys(_changed(constructor))


def keys_argument(constructor: ast.FunctionDef) -> str | None:
    """Returns the name of the argument ``**keys: Unpack[StateKeys]`` of a constructor, None when it has none."""
    match constructor.args.kwarg:
        case ast.arg(arg=name, annotation=ast.Subscript(value=ast.Name("Unpack"), slice=ast.Name("StateKeys"))):
            return name
    return None


def _given(call: ast.Call, of_smach: bool, passed_on: str | None) -> tuple[dict[str, ast.expr], bool]:
    """Returns the arguments of a call of the base's constructor, and whether it may be given others."""
    is_super = isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Call)
    positional = call.args if is_super else call.args[1:]
    given = {str(item.arg): item.value for item in call.keywords if item.arg is not None}
    mappings = [item.value for item in call.keywords if not item.arg]
    starred = any(isinstance(item, ast.Starred) for item in positional) or any(
        not (isinstance(value, ast.Name) and value.id == passed_on) for value in mappings
    )
    if of_smach and not starred:
        given.update(zip(STATE_KEYS, positional, strict=False))
    return given, starred or not of_smach


def _is_option(value: ast.expr, key: str) -> bool:
    match value:
        case ast.Name(id=name):
            return name == key
        case ast.Call(func=ast.Name(id=name), args=[ast.Name(id=inner)]) if name in _COPIES:
            return inner == key
    return False


def _names(value: ast.expr, aliases: Mapping[str, ast.expr]) -> Names:
    try:
        plain = ast.literal_eval(aliases.get(value.id, value) if isinstance(value, ast.Name) else value)
    except (ValueError, TypeError, SyntaxError):
        return None
    is_list = isinstance(plain, list | tuple) and all(isinstance(name, str) for name in plain)
    return tuple(plain) if is_list else None


def _changed(constructor: ast.FunctionDef) -> Iterator[str]:
    """Yields the keys whose option is changed before it is passed on, or to which names are added afterwards."""
    for item in ast.walk(constructor):
        match item:
            case ast.Name(id=name, ctx=ast.Store()) if name in STATE_KEYS:
                yield name
            case ast.Attribute(value=ast.Name(id=name)) if name in STATE_KEYS:
                yield name
            case ast.Attribute(attr=name) if name in _REGISTERS:
                yield _REGISTERS[name]
