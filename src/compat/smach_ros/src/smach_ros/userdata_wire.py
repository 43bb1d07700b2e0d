# SPDX-License-Identifier: BSD-3-Clause
"""Encodes userdata in messages as a pickled dictionary in base64, the format of state machine viewers.

Pickles can execute code. Only plain values and messages are therefore encoded, other values by their type name, and
decoding rejects everything else.
"""

from __future__ import annotations

import base64
import binascii
import importlib
import io
import pickle
import re
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any

import genpy

__all__ = ["UserdataError", "decode", "encode", "is_plain"]

PROTOCOL = 2
"""Pickle protocol of the public smach_ros."""

MAX_VALUE_BYTES = 65536
"""Maximum pickled size of a value [bytes]; larger values are encoded by their type name."""

_PLAIN = (type(None), bool, int, float, complex, str, bytes, bytearray)
_MESSAGE_MODULE = re.compile(r"[A-Za-z]\w*\.(msg|srv)\._\w+")


class UserdataError(ValueError):
    """The text is not valid userdata, or contains disallowed types."""


def is_plain(value: Any) -> bool:
    """Returns whether a value consists only of numbers, texts, collections, times and messages."""
    if isinstance(value, genpy.Message):
        return all(is_plain(getattr(value, slot, None)) for slot in value.__slots__)
    if type(value) in (list, tuple, set, frozenset):
        return all(is_plain(item) for item in value)
    if type(value) in (dict, OrderedDict):
        return all(is_plain(key) and is_plain(item) for key, item in value.items())
    return type(value) in _PLAIN or isinstance(value, genpy.TVal)


def encode(values: Mapping[str, Any], *, strict: bool = False) -> str:
    """Returns userdata as text.

    Args:
        values: Values, keyed by name.
        strict: Whether to raise an error for a value that cannot be encoded, instead of encoding its type name.

    Raises:
        UserdataError: A value cannot be encoded, with ``strict``.
    """
    written: dict[str, Any] = {}
    for key, value in values.items():
        try:
            fits = is_plain(value) and (strict or len(pickle.dumps(value, PROTOCOL)) <= MAX_VALUE_BYTES)
        except Exception:  # the value is modified concurrently, or nested infinitely
            fits = False
        if not fits and strict:
            raise UserdataError(f"userdata '{key}' is a {type(value).__name__}; allowed: plain values and messages")
        written[key] = value if fits else f"<{type(value).__module__}.{type(value).__qualname__}>"
    return base64.b64encode(pickle.dumps(written, PROTOCOL)).decode("ascii")


def decode(text: str) -> dict[str, Any]:
    """Returns userdata from text.

    Raises:
        UserdataError: The text is not a dictionary of plain values and messages.
    """
    if not text:
        return {}
    try:
        values = _PlainUnpickler(io.BytesIO(base64.b64decode(text, validate=True))).load()
    except UserdataError:
        raise
    except binascii.Error as error:
        raise UserdataError(f"userdata is not base64: {error}") from error
    except Exception as error:  # an invalid pickle can raise almost any error
        raise UserdataError(f"userdata is no pickle: {type(error).__name__}: {error}") from error
    if not isinstance(values, dict) or not all(isinstance(key, str) for key in values):
        raise UserdataError(f"userdata must be a dictionary with text as keys, got a {type(values).__name__}")
    return values


def _bytes_from_text(text: str, encoding: str) -> bytes:
    """Replaces ``_codecs.encode``, which protocol 2 uses to store bytes."""
    if encoding != "latin1":
        raise UserdataError(f"userdata holds bytes as '{encoding}'; allowed: latin1")
    return text.encode("latin1")


_ALLOWED: dict[tuple[str, str], Any] = {
    ("builtins", "set"): set,
    ("builtins", "frozenset"): frozenset,
    ("builtins", "bytearray"): bytearray,
    ("builtins", "complex"): complex,
    ("builtins", "bytes"): bytes,
    ("collections", "OrderedDict"): OrderedDict,
    ("_codecs", "encode"): _bytes_from_text,
}


class _PlainUnpickler(pickle.Unpickler):
    """Unpickler restricted to plain types, times and messages."""

    def find_class(self, module: str, name: str) -> Any:
        """Returns an allowed type; raises UserdataError for others."""
        if (module, name) in _ALLOWED:
            return _ALLOWED[module, name]
        if module in ("genpy.rostime", "rospy.rostime") and name in ("Time", "Duration"):
            return getattr(importlib.import_module(module), name)
        if _MESSAGE_MODULE.fullmatch(module):
            found = getattr(importlib.import_module(module), name, None)
            if isinstance(found, type) and issubclass(found, genpy.Message):
                return found
        raise UserdataError(f"userdata holds a '{module}.{name}'; allowed: plain values and messages")
