# SPDX-License-Identifier: BSD-3-Clause
"""Describes userdata in short texts for people: poses, joint positions and counts instead of message dumps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import Any

MAX_CHARACTERS = 300
"""Maximum length of the text of a value."""
MAX_ITEMS = 8
"""Maximum number of listed items of a collection; of longer collections, only the length is stated."""
MAX_DEPTH = 4
"""Maximum nesting of described values."""
_XYZ = ("x", "y", "z")


class WatchedUserdata:
    """A state's userdata that also keeps a text of each written value, because a state cannot read its output keys.

    Args:
        userdata: Userdata as smach passes it to a state.
    """

    def __init__(self, userdata: Any) -> None:
        object.__setattr__(self, "_userdata", userdata)
        object.__setattr__(self, "_texts", {})

    def written_texts(self) -> dict[str, str]:
        """Returns a short text for each written value, keyed by userdata key."""
        return dict(self._texts)

    def keys(self) -> Any:
        """Returns the keys that have a value."""
        return self._userdata.keys()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._userdata, name)

    def __getitem__(self, key: str) -> Any:
        return self._userdata[key]

    def __contains__(self, key: object) -> bool:
        return key in self._userdata

    def __setattr__(self, name: str, value: Any) -> None:
        self[name] = value

    def __setitem__(self, key: str, value: Any) -> None:
        self._userdata[key] = value
        self._texts[key] = value_text(value)


def userdata_texts(userdata: Any, keys: Iterable[str]) -> dict[str, str]:
    """Returns a short text for each userdata key that has a value.

    Args:
        userdata: Userdata as a state receives it.
        keys: Names of the keys.
    """
    texts = {}
    for key in keys:
        try:
            value = userdata[key]
        except Exception:  # no value yet; the state itself reports faults
            continue
        texts[key] = value_text(value)
    return texts


def value_text(value: Any) -> str:
    """Returns a short text for a value.

    Numbers have four significant digits; positions are in metres and angles of orientations in degrees. Objects other
    than plain values, messages and arrays are described by their class.
    """
    try:
        text = _text(value, MAX_DEPTH)
    except Exception:  # values of users can raise anything, and other threads can change a value meanwhile
        text = type(value).__name__
    return text if len(text) <= MAX_CHARACTERS else f"{text[: MAX_CHARACTERS - 1]}…"


def _text(value: Any, depth: int) -> str:
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | str):
        return str(value)
    if isinstance(value, float):
        return f"{value:.4g}"
    slots = _fields_of(value)
    if slots is not None:
        return _message_text(value, slots, depth)
    if isinstance(value, Mapping):
        return _pairs_text(value.items(), len(value), depth)
    if isinstance(value, bytes | bytearray):
        return f"{len(value)} bytes"
    if isinstance(value, list | tuple | set | frozenset):
        return _items_text(value, depth)
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"array {' x '.join(map(str, value.shape))} of {value.dtype}"
    return type(value).__name__


def _fields_of(value: Any) -> tuple[str, ...] | None:
    """Returns the field names of a ROS message or time; None for other values."""
    if hasattr(value, "to_sec"):
        return ()
    return tuple(value.__slots__) if hasattr(value, "_type") and hasattr(value, "__slots__") else None


def _message_text(value: Any, names: tuple[str, ...], depth: int) -> str:
    if hasattr(value, "to_sec"):
        return f"{value.to_sec():.4g} s"
    match names:
        case ("x", "y", "z"):
            return _position_text(value)
        case ("x", "y", "z", "w"):
            return _orientation_text(value)
        case ("data",):
            return _text(value.data, depth)
        case ("header", inner):
            return f"{_text(getattr(value, inner), depth)}{_frame_text(value.header)}"
    if {"joint_names", "points"} <= set(names):
        return _trajectory_text(value)
    if {"name", "position", "velocity"} <= set(names):
        return _pairs_text(zip(value.name, value.position, strict=False), len(value.name), depth)
    if depth == 0:
        return str(value._type)
    described = [(name, getattr(value, name)) for name in names if name not in ("header", "layout")]
    parts = [f"{name} {_text(inner, depth - 1)}" for name, inner in described if not _is_empty(inner)]
    frame = _frame_text(value.header) if "header" in names else ""
    return f"{'; '.join(parts) or f'empty {value._type}'}{frame}"


def _is_empty(value: Any) -> bool:
    """Returns whether a field of a message has its initial value."""
    names = _fields_of(value)
    if names:
        return all(_is_empty(getattr(value, name)) for name in names if name != "header")
    return isinstance(value, str | list | tuple | bytes) and not value


def _frame_text(header: Any) -> str:
    return f", frame {header.frame_id}" if header.frame_id else ""


def _position_text(value: Any) -> str:
    return f"({', '.join(f'{getattr(value, axis):.3f}' for axis in _XYZ)})"


def _orientation_text(value: Any) -> str:
    """Returns roll, pitch and yaw [deg]."""
    x, y, z, w = value.x, value.y, value.z, value.w
    if not any((x, y, z, w)):
        return "not set"
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    angles = {"roll": roll, "pitch": pitch, "yaw": yaw}
    return " ".join(f"{name} {math.degrees(angle):.0f}°" for name, angle in angles.items())


def _trajectory_text(value: Any) -> str:
    if not value.points:
        return "no points"
    duration_s = value.points[-1].time_from_start.to_sec()
    return f"{len(value.points)} points, {duration_s:.2f} s, {len(value.joint_names)} joints"


def _pairs_text(pairs: Iterable[tuple[Any, Any]], length: int, depth: int) -> str:
    if depth == 0 or length == 0:
        return f"{length} entries"
    more = ", …" if length > MAX_ITEMS else ""
    return ", ".join(f"{key} {_text(item, depth - 1)}" for key, item in islice(pairs, MAX_ITEMS)) + more


def _items_text(value: Any, depth: int) -> str:
    if not value:
        return "empty"
    if len(value) > MAX_ITEMS or depth == 0:
        return f"{len(value)} items"
    return f"[{', '.join(_text(item, depth - 1) for item in value)}]"
