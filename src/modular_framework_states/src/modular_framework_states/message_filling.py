# SPDX-License-Identifier: BSD-3-Clause
"""Fills messages of any type from the values of a task and its userdata, and compares messages with such values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import genpy
import genpy.message

from modular_framework_core.state_api.option_uses import USERDATA_PREFIX


class FillingError(ValueError):
    """A value does not fit a message, or a field does not exist; the message gives the field and its type."""


def fill_message(message_type: Any, values: Mapping[str, Any] | None, userdata: Any = None) -> Any:
    """Returns a message filled from a mapping.

    Args:
        message_type: Class of the message or of a service's request.
        values: Field to value, nested like the message; other fields keep their default. The string ``userdata.<key>``
            is replaced by the userdata at that key, and ``userdata.<key>.<field>`` by a field of it.
        userdata: Userdata for such references.

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
    """Returns a value with each reference to userdata replaced by the userdata, as plain values.

    Raises:
        FillingError: The userdata lack the key or field, or the key has no value yet.
    """
    match value:
        case str() if value.startswith(USERDATA_PREFIX):
            key, _, path = value.removeprefix(USERDATA_PREFIX).partition(".")
            if userdata is None or key not in userdata:
                raise FillingError(
                    f"'{value}' refers to userdata that does not exist; add a previous state that writes '{key}', "
                    "and list the key in input_keys"
                )
            if userdata[key] is None:
                raise FillingError(f"'{value}': userdata '{key}' is empty; add a previous state that writes the key")
            return plain(field_at(userdata[key], path))
        case Mapping():
            return {name: with_userdata(item, userdata) for name, item in value.items()}
        case list() | tuple():
            return [with_userdata(item, userdata) for item in value]
    return value


def field_at(message: Any, path: str) -> Any:
    """Returns a field of a message.

    Args:
        message: Message, or a part of a message.
        path: Field names and zero-based list indices, separated by dots; empty for the message itself.

    Raises:
        FillingError: The field or item does not exist; the message lists the existing fields or items.
    """
    value = message
    for name in path.split(".") if path else ():
        fields = list(getattr(value, "__slots__", ()))
        if name in fields:
            value = getattr(value, name)
        elif isinstance(value, list | tuple) and name.isdecimal() and int(name) < len(value):
            value = value[int(name)]
        else:
            there = f"the items 0 to {len(value) - 1}" if isinstance(value, list | tuple) else ", ".join(fields)
            raise FillingError(f"'{path}': there is no '{name}'; there are: {there or 'no fields'}")
    return value


def plain(value: Any) -> Any:
    """Returns a message as a nested mapping of its fields; other values are returned unchanged."""
    match value:
        case genpy.Message():
            return {name: plain(getattr(value, name)) for name in value.__slots__}
        case genpy.TVal():
            return {"secs": value.secs, "nsecs": value.nsecs}
        case list() | tuple():
            return [plain(item) for item in value]
    return value


def difference(message: Any, expected: Mapping[str, Any], where: str = "") -> str:
    """Describes the first field of a message that differs from the expected value; empty if none differs.

    Args:
        message: Message to check.
        expected: Field to value, nested like the message; other fields are not checked.
        where: Path prefix of the message in the description.
    """
    for name, value in expected.items():
        path = f"{where}{name}"
        if name not in getattr(message, "__slots__", ()):
            return f"{path} does not exist; there are {', '.join(getattr(message, '__slots__', ())) or 'no fields'}"
        actual = getattr(message, name)
        if isinstance(value, Mapping):
            inner = difference(actual, value, f"{path}.")
            if inner:
                return inner
        elif plain(actual) != value:
            return f"{path} is {actual!r}, expected {value!r}"
    return ""
