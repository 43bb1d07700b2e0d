# SPDX-License-Identifier: BSD-3-Clause
"""Lets the smaller coefficient of the two surfaces of a contact count, as in Gazebo's engine; PyBullet multiplies them.

Bullet calls a function through a pointer that an application may change (PR 1383 of bullet3). PyBullet has no call for
that, and the linker hides the pointer, so its address is looked up in the symbol table of the loaded library. The
function gets two collision objects. Where these keep their coefficients is found by letting two spheres with known ones
touch, so that nothing here depends on a version or a processor. A library without a symbol table cannot be changed:
the caller then has to give every surface the square root of its coefficient, which is right between equal surfaces.
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
"""A function that the dynamic linker knows, too: it shows where the library was loaded."""

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
"""Of a collision object, which is larger."""
_KNOWN_FRICTION, _KNOWN_RESTITUTION = 0.31415926, 0.27182818

_Combine = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)


@functools.cache
def let_smaller_coefficient_count(api: Any) -> bool:
    """Changes how the engine combines friction and restitution, for all worlds of this process.

    Args:
        api: The module pybullet.

    Returns:
        Whether it could be changed.
    """
    library = Path(api.__file__)
    values = _symbol_values(library, (_FRICTION_POINTER, _RESTITUTION_POINTER, _EXPORTED))
    if values is None:
        return False
    exported = ctypes.cast(getattr(ctypes.CDLL(str(library)), _EXPORTED), ctypes.c_void_p).value or 0
    friction, restitution = (
        ctypes.c_void_p.from_address(exported - values[_EXPORTED] + values[name])
        for name in (_FRICTION_POINTER, _RESTITUTION_POINTER)
    )
    contents = _contents_of_touched_object(api, friction)
    for pointer, known in ((friction, _KNOWN_FRICTION), (restitution, _KNOWN_RESTITUTION)):
        place = contents.find(struct.pack("d", known))
        if place < 0 or place % 8:
            return False
        pointer.value = _compiled_minimum(place // 8)
    return True


def _symbol_values(library: Path, names: Sequence[str]) -> dict[str, int] | None:
    """Returns the addresses of symbols relative to where an ELF library is loaded, or None if they are not there."""
    with library.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data[:5] != _ELF_64:
            return None
        (sections_at,) = struct.unpack_from("Q", data, 0x28)
        (count,) = struct.unpack_from("H", data, 0x3C)
        sections = np.frombuffer(data[sections_at : sections_at + count * _SECTION.itemsize], _SECTION)
        tables = sections[sections["type"] == _SYMBOL_TABLE]
        if len(tables) != 1:
            return None
        table, text = tables[0], sections[tables[0]["link"]]
        begin, end = int(table["offset"]), int(table["offset"] + table["size"])
        symbols = np.frombuffer(data[begin:end], _SYMBOL)
        begin, end = int(text["offset"]), int(text["offset"] + text["size"])
        values = {}
        for name in names:
            place = data.find(b"\0" + name.encode() + b"\0", begin, end) + 1 - begin
            found = symbols[symbols["name"] == place]
            if len(found) != 1:
                return None
            values[name] = int(found[0]["value"])
        return values


def _contents_of_touched_object(api: Any, friction: ctypes.c_void_p) -> bytes:
    """Returns the first bytes of a collision object that has the known coefficients."""
    seen: list[bytes] = []

    def look(first: int, second: int) -> float:
        seen.extend(ctypes.string_at(each, _SEARCHED_BYTES) for each in (first, second))
        return 0.0

    callback, before = _Combine(look), friction.value
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
        friction.value = before
        api.disconnect(client)
    return seen[0] if seen else b""


_kept: list[Any] = []
"""Compiled functions that the engine calls; they must not be collected."""


def _compiled_minimum(index: int) -> int:
    """Returns the address of a compiled function: the smaller of the numbers at an index of two arrays."""
    import numba  # half a second that only a simulation pays

    types: Any = numba.types
    numbers = types.CPointer(types.float64)

    @numba.cfunc(types.float64(numbers, numbers))
    def minimum(first: Any, second: Any) -> Any:
        return min(first[index], second[index])

    _kept.append(minimum)
    return int(minimum.address or 0)
