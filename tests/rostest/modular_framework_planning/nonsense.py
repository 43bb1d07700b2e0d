# SPDX-License-Identifier: BSD-3-Clause
"""Fills any message with nonsense, field by field, so that no endpoint and no field is forgotten."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import genpy

NAN, HUGE = float("nan"), 1e308
INTEGERS = {
    "int8": 7,
    "int16": 15,
    "int32": 31,
    "int64": 63,
    "uint8": 8,
    "uint16": 16,
    "uint32": 32,
    "uint64": 64,
    "byte": 7,
    "char": 8,
}


@dataclass(frozen=True)
class Nonsense:
    """What goes into the fields.

    Attributes:
        number: of every float.
        name: of every string.
        lengths: of lists, taken in turn.
        extreme: integers at the ends of their range, durations negative; otherwise 0.
    """

    number: float
    name: str
    lengths: tuple[int, ...]
    extreme: bool = False


STYLES = {
    "nothing": Nonsense(0.0, "", (0,)),
    "not a number": Nonsense(NAN, "world", (1,)),
    "infinite": Nonsense(float("inf"), "world", (1,)),
    "huge": Nonsense(HUGE, "elbow_joint", (1,), True),
    "wrong names": Nonsense(0.5, "no such name", (1,)),
    "wrong lengths": Nonsense(0.25, "elbow_joint", (1, 2, 0, 3)),
    "zeros": Nonsense(0.0, "world", (2,)),
    "negative": Nonsense(-1.0, "arm_and_manipulator", (1,), True),
}


def nonsense(kind: type[Any], style: Nonsense) -> Any:
    """Returns a message of that class with nonsense in all its fields."""
    lengths, signs = itertools.cycle(style.lengths), itertools.cycle((-1, 1))

    def integer(bits: int, signed: bool) -> int:
        if not style.extreme:
            return 0
        if not signed:
            return 2**bits - 1
        return -(2**bits) if next(signs) < 0 else 2**bits - 1

    def value(name: str) -> Any:
        base, bracket, rest = name.partition("[")
        if bracket:
            count = int(rest[:-1]) if rest[:-1] else next(lengths)
            return bytes(count) if base in ("uint8", "char") else [value(base) for _ in range(count)]
        if name in ("float32", "float64"):
            return 3e38 if name == "float32" and style.number == HUGE else style.number
        if name == "string":
            return style.name
        if name == "bool":
            return style.extreme
        if name in INTEGERS:
            return integer(INTEGERS[name], not name.startswith("u") and name != "char")
        if name == "time":
            return genpy.Time()
        if name == "duration":
            return genpy.Duration(-5, 0) if style.extreme else genpy.Duration()
        return fill(genpy.message.get_message_class(name)())

    def fill(message: Any) -> Any:
        for slot, name in zip(message.__slots__, message._slot_types, strict=True):
            setattr(message, slot, value("std_msgs/Header" if name == "Header" else name))
        return message

    return fill(kind())
