# SPDX-License-Identifier: BSD-3-Clause
"""Makes PyBullet use the smaller friction and restitution coefficient of a contact, as Gazebo's engine does.

By default, PyBullet multiplies the two coefficients. Bullet calls the combining function through a pointer that an
application may change (PR 1383 of bullet3). PyBullet has no call for this change, and the linker hides the pointer. The
address of the pointer is therefore taken from the symbol table of the loaded library. The combining function receives
two collision objects. A test contact of two spheres with known coefficients reveals where these objects store the
coefficients, for any version and processor. Without a symbol table, the pointer cannot be changed. The caller must then
set the square root of each coefficient, which is exact for equal surfaces.
"""

from __future__ import annotations

import ctypes
import functools
import mmap
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

_FRICTION_POINTER = "gCalculateCombinedFrictionCallback"
_RESTITUTION_POINTER = "gCalculateCombinedRestitutionCallback"
_EXPORTED = "b3ChangeDynamicsInfoSetLateralFriction"
"""Symbol that the dynamic linker also knows, so that its address reveals the load address of the library."""

_ELF_64 = b"\x7fELF\x02"
_SYMBOL_TABLE = 2
_SECTION = np.dtype(
    [("name", "u4"), ("type", "u4"), ("flags", "u8"), ("address", "u8"), ("offset", "u8"), ("size", "u8")]
    + [("link", "u4"), ("info", "u4"), ("alignment", "u8"), ("entry_size", "u8")]
)
_SYMBOL = np.dtype(
    [("name", "u4"), ("info", "u1"), ("other", "u1"), ("section", "u2"), ("value", "u8"), ("size", "u8")]
)

_SEARCHED_BYTES = 512
"""Number of searched bytes per collision object; a collision object is larger."""
_KNOWN_FRICTION, _KNOWN_RESTITUTION = 0.31415926, 0.27182818

_Combine = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)


@functools.cache
def use_smaller_coefficients(api: Any) -> bool:
    """Makes the engine use the minimum of two friction or restitution coefficients, in all worlds of this process.

    Args:
        api: Module pybullet.

    Returns:
        Whether the change was possible.
    """
    library = Path(api.__file__)
    addresses = _relative_addresses(library, (_FRICTION_POINTER, _RESTITUTION_POINTER, _EXPORTED))
    if addresses is None:
        return False
    exported = ctypes.cast(getattr(ctypes.CDLL(str(library)), _EXPORTED), ctypes.c_void_p).value or 0
    friction, restitution = (
        ctypes.c_void_p.from_address(exported - addresses[_EXPORTED] + addresses[name])
        for name in (_FRICTION_POINTER, _RESTITUTION_POINTER)
    )
    contents = _object_memory(api, friction)
    for pointer, coefficient in ((friction, _KNOWN_FRICTION), (restitution, _KNOWN_RESTITUTION)):
        offset = contents.find(struct.pack("d", coefficient))
        if offset < 0 or offset % 8:
            return False
        pointer.value = _compiled_minimum(offset // 8)
    return True


def _relative_addresses(library: Path, names: Sequence[str]) -> dict[str, int] | None:
    """Returns the addresses of symbols relative to the load address of an ELF library; None if a symbol is missing."""
    with library.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data[:5] != _ELF_64:
            return None
        (section_offset,) = struct.unpack_from("Q", data, 0x28)
        (count,) = struct.unpack_from("H", data, 0x3C)
        sections = np.frombuffer(data[section_offset : section_offset + count * _SECTION.itemsize], _SECTION)
        tables = sections[sections["type"] == _SYMBOL_TABLE]
        if len(tables) != 1:
            return None
        table, names_section = tables[0], sections[tables[0]["link"]]
        begin, end = int(table["offset"]), int(table["offset"] + table["size"])
        symbols = np.frombuffer(data[begin:end], _SYMBOL)
        begin, end = int(names_section["offset"]), int(names_section["offset"] + names_section["size"])
        addresses = {}
        for name in names:
            offset = data.find(b"\0" + name.encode() + b"\0", begin, end) + 1 - begin
            matches = symbols[symbols["name"] == offset]
            if len(matches) != 1:
                return None
            addresses[name] = int(matches[0]["value"])
        return addresses


def _object_memory(api: Any, friction: ctypes.c_void_p) -> bytes:
    """Returns the first bytes of a collision object with the known coefficients, recorded in a test contact."""
    memory: list[bytes] = []

    def record(first: int, second: int) -> float:
        memory.extend(ctypes.string_at(each, _SEARCHED_BYTES) for each in (first, second))
        return 0.0

    callback, original = _Combine(record), friction.value
    client = api.connect(api.DIRECT)
    friction.value = ctypes.cast(callback, ctypes.c_void_p).value
    try:
        for x in (0.0, 1.0):
            ball = api.createCollisionShape(api.GEOM_SPHERE, radius=0.55, physicsClientId=client)
            body = api.createMultiBody(1.0, ball, basePosition=(x, 0.0, 0.0), physicsClientId=client)
            api.changeDynamics(
                body, -1, lateralFriction=_KNOWN_FRICTION, restitution=_KNOWN_RESTITUTION, physicsClientId=client
            )
        api.stepSimulation(physicsClientId=client)
    finally:
        friction.value = original
        api.disconnect(client)
    return memory[0] if memory else b""


_compiled_functions: list[Any] = []
"""Compiled functions that the engine calls; the references prevent garbage collection."""


def _compiled_minimum(index: int) -> int:
    """Compiles a function that returns the smaller element at an index of two arrays; returns its address."""
    import numba  # takes half a second, so only simulations import numba

    types: Any = numba.types
    array = types.CPointer(types.float64)

    @numba.cfunc(types.float64(array, array))
    def minimum(first: Any, second: Any) -> Any:
        return min(first[index], second[index])

    _compiled_functions.append(minimum)
    return int(minimum.address or 0)
