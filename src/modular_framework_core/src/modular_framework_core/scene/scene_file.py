# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes MoveIt's text scenes, the collision objects around a real robot.

A scene is a name, then objects, then a line with a single dot. Two layouts are in use: the older one begins an object
with the number of its shapes, the newer one with the pose of the object, and ends it with named subframes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from modular_framework_urdf.rotations import multiply_quaternions, rotate_vector

SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2, "plane": 4}
"""Numbers of each kind of shape: sides; radius; radius and length; radius and length; a, b, c and d. All [m] or 1."""

Vector = tuple[float, ...]
NO_COLOR: Vector = (0.0, 0.0, 0.0, 0.0)


class SceneFileError(ValueError):
    """A scene file cannot be read; the text names file and line, what is there and what is expected."""


@dataclass(frozen=True, slots=True)
class SceneShape:
    """One shape of an object.

    Attributes:
        kind: box, sphere, cylinder, cone, plane or mesh.
        size: Numbers of the shape as in ``SIZES``; empty for a mesh.
        position: x, y, z in the frame of the object [m].
        quaternion_xyzw: Orientation in the frame of the object.
        vertices: Corners of a mesh, each x, y, z [m].
        triangles: Each three indices into ``vertices``.
        color: Red, green, blue, alpha in 0..1; all 0 for none.
    """

    kind: str
    size: Vector
    position: Vector
    quaternion_xyzw: Vector
    vertices: tuple[Vector, ...] = ()
    triangles: tuple[tuple[int, ...], ...] = ()
    color: Vector = NO_COLOR


@dataclass(frozen=True, slots=True)
class SceneObject:
    """One object of a scene.

    Attributes:
        name: Id of the object.
        position: x, y, z in the planning frame [m].
        quaternion_xyzw: Orientation in the planning frame.
        shapes: What it is made of.
        subframes: (name, position, quaternion_xyzw) of named frames on the object, in its frame.
    """

    name: str
    position: Vector
    quaternion_xyzw: Vector
    shapes: tuple[SceneShape, ...]
    subframes: tuple[tuple[str, Vector, Vector], ...] = ()

    @property
    def color(self) -> Vector:
        """The colour of the first shape that has one."""
        return next((shape.color for shape in self.shapes if shape.color != NO_COLOR), NO_COLOR)


@dataclass(frozen=True, slots=True)
class Scene:
    """Contents of a scene file: its name and its objects in file order."""

    name: str
    objects: tuple[SceneObject, ...]


class _Lines:
    """The lines of a file, empty ones left out, with their numbers."""

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
        self._next = 0

    def peek(self) -> str:
        return self._lines[self._next][1] if self._next < len(self._lines) else ""

    def next_line(self, expected: str) -> str:
        if self._next >= len(self._lines):
            raise SceneFileError(f"{self._path}: the file ends where {expected} is expected; a scene ends with '.'")
        self._next += 1
        return self._lines[self._next - 1][1]

    def fault(self, expected: str) -> SceneFileError:
        number, line = self._lines[self._next - 1]
        return SceneFileError(f"{self._path}:{number}: got '{line[:60]}', expected {expected}")

    def numbers(self, count: int, what: str) -> Vector:
        expected = f"{what} ({count} finite number{'s' if count > 1 else ''})"
        words = self.next_line(expected).split()
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


def read_scene_file(path: Path) -> Scene:
    """Reads a scene file.

    Args:
        path: The file.

    Returns:
        Its name and its objects.

    Raises:
        SceneFileError: The file cannot be read or is no scene.
    """
    try:
        lines = _Lines(path, path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        present = ", ".join(sorted(file.name for file in path.parent.glob("*.scene"))) or "none"
        raise SceneFileError(f"{path}: cannot be read ({error}); scenes in its folder: {present}") from error
    name = lines.next_line("the name of the scene")
    objects: list[SceneObject] = []
    while (line := lines.next_line("an object ('* name') or the end ('.')")) != ".":
        if not line.startswith("* "):
            raise lines.fault("an object ('* name') or the end ('.')")
        body = line[2:].strip()
        if body in {known.name for known in objects}:
            raise lines.fault("a name that no object above has")
        objects.append(_read_object(body, lines))
    return Scene(name, tuple(objects))


def _read_object(name: str, lines: _Lines) -> SceneObject:
    position: Vector = (0.0, 0.0, 0.0)
    quaternion: Vector = (0.0, 0.0, 0.0, 1.0)
    has_pose = len(lines.peek().split()) > 1
    if has_pose:
        position = lines.numbers(3, f"the position of object '{name}'")
        quaternion = lines.quaternion(f"the orientation of object '{name}'")
    (count,) = lines.counts(1, f"the number of shapes of object '{name}'")
    shapes = tuple(_read_shape(lines) for _ in range(count))
    subframes: list[tuple[str, Vector, Vector]] = []
    if has_pose:
        (subframe_count,) = lines.counts(1, f"the number of subframes of object '{name}'")
        for _ in range(subframe_count):
            subframes.append(
                (
                    lines.next_line("the name of a subframe"),
                    lines.numbers(3, "the position of a subframe"),
                    lines.quaternion("the orientation of a subframe"),
                )
            )
    return SceneObject(name, position, quaternion, shapes, tuple(subframes))


def _read_shape(lines: _Lines) -> SceneShape:
    kind = lines.next_line("the kind of a shape")
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
    color = lines.numbers(4, f"the colour of a {kind}")
    if not all(0.0 <= share <= 1.0 for share in color):
        raise lines.fault(f"the colour of a {kind}, red, green, blue and alpha in 0..1")
    return SceneShape(kind, size, position, quaternion, vertices, triangles, color)


def _triangle(lines: _Lines, corners: int) -> tuple[int, ...]:
    indices = lines.counts(3, "a triangle")
    if max(indices) >= corners:
        raise lines.fault(f"a triangle of indices below {corners}")
    return indices


def scene_text(scene: Scene, old_layout: bool = False) -> str:
    """Writes a scene.

    Args:
        scene: What to write.
        old_layout: Without poses of objects, which are put into the poses of the shapes, and without subframes.

    Returns:
        The text of a scene file.

    Raises:
        SceneFileError: A name does not fit on a line of its own, or the old layout has no place for a subframe.
    """
    lines = [_name(scene.name, "scene")]
    for thing in scene.objects:
        lines.append(f"* {_name(thing.name, 'object')}")
        if old_layout and thing.subframes:
            raise SceneFileError(
                f"object '{thing.name}': got {len(thing.subframes)} subframes, the older layout has "
                "none; write the newer layout"
            )
        if not old_layout:
            lines += _pose_lines(thing.position, thing.quaternion_xyzw)
        lines.append(str(len(thing.shapes)))
        for shape in thing.shapes:
            lines += _shape_lines(shape, thing if old_layout else None)
        if not old_layout:
            lines.append(str(len(thing.subframes)))
            for name, position, quaternion in thing.subframes:
                lines += [_name(name, "subframe"), *_pose_lines(position, quaternion)]
    return "\n".join([*lines, ".", ""])


def _name(name: str, what: str) -> str:
    if not name.strip() or len(name.splitlines()) != 1:
        raise SceneFileError(f"name of the {what}: got '{name}', expected one line that is not empty; rename it")
    return name


def _shape_lines(shape: SceneShape, thing: SceneObject | None) -> list[str]:
    """Lines of a shape; its pose is combined with that of the object, if one is given."""
    position, quaternion = shape.position, shape.quaternion_xyzw
    if thing is not None:
        turned = rotate_vector(thing.quaternion_xyzw, position)
        position = tuple(a + b for a, b in zip(thing.position, turned, strict=True))
        quaternion = multiply_quaternions(thing.quaternion_xyzw, quaternion)
    sizes = [_numbers(shape.size)]
    if shape.kind == "mesh":
        sizes = [
            f"{len(shape.vertices)} {len(shape.triangles)}",
            *map(_numbers, shape.vertices),
            *(" ".join(map(str, indices)) for indices in shape.triangles),
        ]
    return [shape.kind, *sizes, *_pose_lines(position, quaternion), _numbers(shape.color)]


def _pose_lines(position: Vector, quaternion_xyzw: Vector) -> list[str]:
    return [_numbers(position), _numbers(quaternion_xyzw)]


def _numbers(values: Vector) -> str:
    return " ".join(f"{value:.12g}" for value in values)
