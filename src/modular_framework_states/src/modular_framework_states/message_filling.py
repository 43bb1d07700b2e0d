# SPDX-License-Identifier: BSD-3-Clause
"""Fills messages of any type with values from a task and its userdata, and compares their fields with such values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import genpy
import genpy.message

from modular_framework_core.state_api.option_uses import USERDATA_PREFIX


class FillingError(ValueError):
    """Values do not fit a message, or a field is not there; the text names the field and what it takes."""


def filled(message_type: Any, values: Mapping[str, Any] | None, userdata: Any = None) -> Any:
    """Makes a message of a mapping.

    Args:
        message_type: Class of the message (or of a service's request).
        values: Field to value, nested as the message is; fields left out keep their default. A text
            ``userdata.<key>`` stands for what userdata has there, ``userdata.<key>.<field>`` for a field of that.
        userdata: Where such references are looked up.

    Raises:
        FillingError: A field does not exist, or a value has the wrong type.
    """
    message = message_type()
    content = with_userdata(dict(values or {}), userdata)
    try:
        genpy.message.fill_message_args(message, [content], {"now": genpy.Time(), "auto": genpy.Time()})
        message._check_types()
    except (genpy.MessageException, ValueError, TypeError, AttributeError) as error:
        kinds = zip(message.__slots__, message._slot_types, strict=True)
        fields = ", ".join(f"{name} ({kind})" for name, kind in kinds) or "none"
        raise FillingError(f"the values do not fit {message._type}: {error}; its fields are {fields}") from error
    return message


def with_userdata(value: Any, userdata: Any) -> Any:
    """Returns a value of a task in which each reference to userdata is replaced by what is there, as plain values.

    Raises:
        FillingError: Userdata has no such key or field, or nothing is in it yet.
    """
    match value:
        case str() if value.startswith(USERDATA_PREFIX):
            key, _, path = value.removeprefix(USERDATA_PREFIX).partition(".")
            if userdata is None or key not in userdata:
                raise FillingError(
                    f"'{value}' refers to userdata that is not there; let a state before write '{key}', "
                    "and name it in input_keys"
                )
            if userdata[key] is None:
                raise FillingError(f"'{value}': userdata '{key}' is empty; let a state before write it")
            return plain(field_at(userdata[key], path))
        case Mapping():
            return {name: with_userdata(item, userdata) for name, item in value.items()}
        case list() | tuple():
            return [with_userdata(item, userdata) for item in value]
    return value


def field_at(message: Any, path: str) -> Any:
    """Returns a field of a message.

    Args:
        message: The message, or a part of one.
        path: Names of fields, and numbers of items from 0, separated by points; empty for the message itself.

    Raises:
        FillingError: There is no such field or item; says what there is.
    """
    found = message
    for name in path.split(".") if path else ():
        fields = list(getattr(found, "__slots__", ()))
        if name in fields:
            found = getattr(found, name)
        elif isinstance(found, list | tuple) and name.isdecimal() and int(name) < len(found):
            found = found[int(name)]
        else:
            there = f"the items 0 to {len(found) - 1}" if isinstance(found, list | tuple) else ", ".join(fields)
            raise FillingError(f"'{path}': there is no '{name}'; there are: {there or 'no fields'}")
    return found


def plain(value: Any) -> Any:
    """Returns a message as a mapping of its fields, nested as it is; other values as they are."""
    match value:
        case genpy.Message():
            return {name: plain(getattr(value, name)) for name in value.__slots__}
        case genpy.TVal():
            return {"secs": value.secs, "nsecs": value.nsecs}
        case list() | tuple():
            return [plain(item) for item in value]
    return value


def difference(message: Any, expected: Mapping[str, Any], where: str = "") -> str:
    """Says which field of a message is not as expected; nothing when all are.

    Args:
        message: The message.
        expected: Field to value, nested as the message is; fields left out may be anything.
        where: Path of the message, for the text.
    """
    for name, value in expected.items():
        path = f"{where}{name}"
        if name not in getattr(message, "__slots__", ()):
            return f"{path} does not exist; there are {', '.join(getattr(message, '__slots__', ())) or 'no fields'}"
        found = getattr(message, name)
        if isinstance(value, Mapping):
            inner = difference(found, value, f"{path}.")
            if inner:
                return inner
        elif plain(found) != value:
            return f"{path} is {found!r}, expected {value!r}"
    return ""
