# SPDX-License-Identifier: BSD-3-Clause
"""Reads MoveIt's text scenes, which tell a planner what stands around a real robot.

A scene is a name, then objects, then a line with a single dot. Two layouts are in use: the older one begins an object
with the number of its shapes, the newer one with the pose of the object, and ends it with named subframes.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2, "plane": 4}
"""Numbers of each kind of shape: sides; radius; radius and length; radius and length; a, b, c and d. All [m] or 1."""

Vector = tuple[float, ...]


class SceneFileError(ValueError):
    """A scene file cannot be read; the text names file and line, what is there and what is expected."""


@dataclass(frozen=True, slots=True)
class SceneShape:
    """One shape of an object.

    Attributes:
        kind: box, sphere, cylinder, cone, plane or mesh.
        size: numbers of the shape as in ``SIZES``; empty for a mesh.
        position: x, y, z in the frame of the object [m].
        quaternion_xyzw: orientation in the frame of the object.
        vertices: corners of a mesh, each x, y, z [m].
        triangles: each three indices into ``vertices``.
    """

    kind: str
    size: Vector
    position: Vector
    quaternion_xyzw: Vector
    vertices: tuple[Vector, ...] = ()
    triangles: tuple[tuple[int, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class SceneObject:
    """One object of a scene.

    Attributes:
        name: id of the object.
        position: x, y, z in the planning frame [m].
        quaternion_xyzw: orientation in the planning frame.
        shapes: what it is made of.
        subframes: (name, position, quaternion_xyzw) of named places on the object, in its frame.
    """

    name: str
    position: Vector
    quaternion_xyzw: Vector
    shapes: tuple[SceneShape, ...]
    subframes: tuple[tuple[str, Vector, Vector], ...] = ()


class _Lines:
    """The lines of a file, empty ones left out, with their numbers."""

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
        self._next = 0

    def peek(self) -> str:
        return self._lines[self._next][1] if self._next < len(self._lines) else ""

    def take(self, expected: str) -> str:
        if self._next >= len(self._lines):
            raise SceneFileError(f"{self._path}: the file ends where {expected} is expected; a scene ends with '.'")
        self._next += 1
        return self._lines[self._next - 1][1]

    def fault(self, expected: str) -> SceneFileError:
        number, line = self._lines[self._next - 1]
        return SceneFileError(f"{self._path}:{number}: got '{line[:60]}', expected {expected}")

    def numbers(self, count: int, what: str) -> Vector:
        expected = f"{what} ({count} finite number{'s' if count > 1 else ''})"
        words = self.take(expected).split()
        try:
            values = tuple(float(word) for word in words)
        except ValueError as error:
            raise self.fault(expected) from error
        if len(values) != count or not all(map(math.isfinite, values)):
            raise self.fault(expected)
        return values

    def counts(self, count: int, what: str) -> tuple[int, ...]:
        values = self.numbers(count, what)
        if any(value < 0 or value != int(value) for value in values):
            raise self.fault(f"{what}, whole and not negative")
        return tuple(int(value) for value in values)

    def quaternion(self, what: str) -> Vector:
        values = self.numbers(4, what)
        length = math.hypot(*values)
        if abs(length - 1.0) > 1e-2:
            raise self.fault(f"{what} as a unit quaternion x y z w, this one has the length {length:.4g}")
        return tuple(value / length for value in values)


def read_scene_file(path: Path) -> list[SceneObject]:
    """Reads a scene file.

    Args:
        path: the file.

    Returns:
        Its objects in file order.

    Raises:
        SceneFileError: the file cannot be read or is no scene.
    """
    try:
        lines = _Lines(path, path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        present = ", ".join(sorted(file.name for file in path.parent.glob("*.scene"))) or "none"
        raise SceneFileError(f"{path}: cannot be read ({error}); scenes in its folder: {present}") from error
    lines.take("the name of the scene")
    objects: list[SceneObject] = []
    while (line := lines.take("an object ('* name') or the end ('.')")) != ".":
        if not line.startswith("* "):
            raise lines.fault("an object ('* name') or the end ('.')")
        name = line[2:].strip()
        if name in {known.name for known in objects}:
            raise lines.fault("a name that no object above has")
        objects.append(_read_object(name, lines))
    return objects


def _read_object(name: str, lines: _Lines) -> SceneObject:
    position: Vector = (0.0, 0.0, 0.0)
    quaternion: Vector = (0.0, 0.0, 0.0, 1.0)
    has_pose = len(lines.peek().split()) > 1
    if has_pose:
        position = lines.numbers(3, f"the position of object '{name}'")
        quaternion = lines.quaternion(f"the orientation of object '{name}'")
    count, = lines.counts(1, f"the number of shapes of object '{name}'")
    shapes = tuple(_read_shape(lines) for _ in range(count))
    subframes: list[tuple[str, Vector, Vector]] = []
    if has_pose:
        places, = lines.counts(1, f"the number of subframes of object '{name}'")
        for _ in range(places):
            subframes.append((lines.take("the name of a subframe"), lines.numbers(3, "the position of a subframe"),
                              lines.quaternion("the orientation of a subframe")))
    return SceneObject(name, position, quaternion, shapes, tuple(subframes))


def _read_shape(lines: _Lines) -> SceneShape:
    kind = lines.take("the kind of a shape")
    vertices: tuple[Vector, ...] = ()
    triangles: tuple[tuple[int, ...], ...] = ()
    size: Vector = ()
    if kind == "mesh":
        corners, faces = lines.counts(2, "the numbers of vertices and triangles")
        vertices = tuple(lines.numbers(3, "a vertex") for _ in range(corners))
        triangles = tuple(_triangle(lines, corners) for _ in range(faces))
    elif kind in SIZES:
        size = lines.numbers(SIZES[kind], f"the size of a {kind}")
        if kind != "plane" and min(size) <= 0.0:
            raise lines.fault(f"the size of a {kind}, more than 0")
    else:
        raise lines.fault(f"a kind of shape: {', '.join((*SIZES, 'mesh'))}")
    position = lines.numbers(3, f"the position of a {kind}")
    quaternion = lines.quaternion(f"the orientation of a {kind}")
    lines.numbers(4, f"the colour of a {kind}")
    return SceneShape(kind, size, position, quaternion, vertices, triangles)


def _triangle(lines: _Lines, corners: int) -> tuple[int, ...]:
    indices = lines.counts(3, "a triangle")
    if max(indices) >= corners:
        raise lines.fault(f"a triangle of indices below {corners}")
    return indices
