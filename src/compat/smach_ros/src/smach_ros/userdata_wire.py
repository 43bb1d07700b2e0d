# SPDX-License-Identifier: BSD-3-Clause
"""Userdata as text in messages: a pickled dictionary in base64, as viewers of state machines expect it.

Pickles can run code. So only plain values and messages are written (of others, only their type), and nothing else
is ever read.
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
"""Pickle protocol of the public implementation."""

MAX_VALUE_BYTES = 65536
"""Values that are larger when pickled [bytes] are written as their type only."""

_PLAIN = (type(None), bool, int, float, complex, str, bytes, bytearray)
_MESSAGE_MODULE = re.compile(r"[A-Za-z]\w*\.(msg|srv)\._\w+")


class UserdataError(ValueError):
    """Text is no userdata, or holds what is not allowed in it."""


def is_plain(value: Any) -> bool:
    """Returns whether a value consists of numbers, texts, collections, times and messages only."""
    if isinstance(value, genpy.Message):
        return all(is_plain(getattr(value, slot, None)) for slot in value.__slots__)
    if type(value) in (list, tuple, set, frozenset):
        return all(is_plain(item) for item in value)
    if type(value) in (dict, OrderedDict):
        return all(is_plain(key) and is_plain(item) for key, item in value.items())
    return type(value) in _PLAIN or isinstance(value, genpy.TVal)


def encode(values: Mapping[str, Any], *, strict: bool = False) -> str:
    """Writes userdata as text.

    Args:
        values: by key.
        strict: whether a value that cannot be written is an error; else its type is written instead.

    Raises:
        UserdataError: there is one, and ``strict``.
    """
    written: dict[str, Any] = {}
    for key, value in values.items():
        try:
            fits = is_plain(value) and (strict or len(pickle.dumps(value, PROTOCOL)) <= MAX_VALUE_BYTES)
        except Exception:  # changed by its owner meanwhile, or nested without end: written as its type
            fits = False
        if not fits and strict:
            raise UserdataError(f"userdata '{key}' is a {type(value).__name__}; allowed are plain values and messages")
        written[key] = value if fits else f"<{type(value).__module__}.{type(value).__qualname__}>"
    return base64.b64encode(pickle.dumps(written, PROTOCOL)).decode("ascii")


def decode(text: str) -> dict[str, Any]:
    """Reads userdata that was written as text.

    Raises:
        UserdataError: it is no dictionary of plain values and messages.
    """
    if not text:
        return {}
    try:
        values = _PlainUnpickler(io.BytesIO(base64.b64decode(text, validate=True))).load()
    except UserdataError:
        raise
    except binascii.Error as error:
        raise UserdataError(f"userdata is not base64: {error}") from error
    except Exception as error:  # a pickle that is broken can raise nearly anything
        raise UserdataError(f"userdata is no pickle: {type(error).__name__}: {error}") from error
    if not isinstance(values, dict) or not all(isinstance(key, str) for key in values):
        raise UserdataError(f"userdata must be a dictionary with text as keys, got a {type(values).__name__}")
    return values


def _bytes_from_text(text: str, encoding: str) -> bytes:
    """Stands in for ``_codecs.encode``, by which protocol 2 writes bytes."""
    if encoding != "latin1":
        raise UserdataError(f"userdata holds bytes as '{encoding}'; allowed is latin1")
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
    """Finds plain types, times and messages, and nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """Returns a type that is allowed in a pickle."""
        if (module, name) in _ALLOWED:
            return _ALLOWED[module, name]
        if module in ("genpy.rostime", "rospy.rostime") and name in ("Time", "Duration"):
            return getattr(importlib.import_module(module), name)
        if _MESSAGE_MODULE.fullmatch(module):
            found = getattr(importlib.import_module(module), name, None)
            if isinstance(found, type) and issubclass(found, genpy.Message):
                return found
        raise UserdataError(f"userdata holds a '{module}.{name}'; allowed are plain values and messages")
