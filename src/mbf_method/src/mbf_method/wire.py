# SPDX-License-Identifier: BSD-3-Clause
"""Converts messages to msgpack bytes and back; NumPy arrays have the encoding of openpi-client."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgpack
import numpy as np

from mbf_method.errors import InvalidOutputError

PROTOCOL = "mbf_method"
OPENPI = "openpi"
"""Protocol of policy servers that send metadata first and do not state a version."""
VERSION = 2
"""Version of the messages; method and framework must have the same version."""
REFUSED_KINDS = "VOc"
"""NumPy dtype kinds without an encoding: structures, Python objects, complex numbers."""


def pack(message: Any) -> bytes:
    """Encodes a dictionary of plain values, arrays and dataclasses; a dataclass becomes a dictionary of its fields.

    Raises:
        TypeError: A value has no encoding.
    """
    return msgpack.packb(message, default=_encode)


def unpack(data: bytes) -> dict[str, Any]:
    """Decodes a dictionary of plain values and arrays.

    Raises:
        InvalidOutputError: The bytes are not an encoded dictionary.
    """
    try:
        message = msgpack.unpackb(data, object_hook=_decode)
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidOutputError(f"a message of {len(data)} bytes is not valid msgpack: {error}") from error
    if not isinstance(message, dict):
        raise InvalidOutputError(f"a message is a {type(message).__name__}; it must be a dictionary")
    return message


def _encode(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if not isinstance(value, (np.ndarray, np.generic)) or value.dtype.kind in REFUSED_KINDS:
        raise TypeError(f"a {getattr(value, 'dtype', type(value).__name__)} has no encoding; use numbers and arrays")
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}


def _decode(value: dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        array = np.frombuffer(value[b"data"], dtype=np.dtype(value[b"dtype"])).reshape(value[b"shape"])
        return array.copy()  # writable, as PyTorch expects
    if b"__npgeneric__" in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    return value
