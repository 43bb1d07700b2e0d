# SPDX-License-Identifier: BSD-3-Clause
"""Turns what a task file says about a message into the message, and back."""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import genpy
import genpy.message


class FillingError(ValueError):
    """Values do not fit a message; the text names the field and what it takes."""


def filled(message_type: Any, values: Mapping[str, Any] | None) -> Any:
    """Makes a message of a mapping.

    Args:
        message_type: Class of the message (or of a service's request).
        values: Field to value, nested as the message is; fields left out keep their default.

    Raises:
        FillingError: A field does not exist, or a value has the wrong type.
    """
    message = message_type()
    try:
        genpy.message.fill_message_args(message, [dict(values or {})], {"now": genpy.Time(), "auto": genpy.Time()})
        message._check_types()
    except (genpy.MessageException, ValueError, TypeError, AttributeError) as error:
        kinds = zip(message.__slots__, message._slot_types, strict=True)
        fields = ", ".join(f"{name} ({kind})" for name, kind in kinds) or "none"
        raise FillingError(f"the values do not fit {message._type}: {error}; its fields are {fields}") from error
    return message


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
        elif (list(found) if isinstance(found, tuple) else found) != value:
            return f"{path} is {found!r}, expected {value!r}"
    return ""
