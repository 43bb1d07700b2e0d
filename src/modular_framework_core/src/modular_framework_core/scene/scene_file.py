# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes MoveIt's text scenes, which describe collision objects.

A text scene consists of a name, objects and a line with a single dot. In the old layout, an object begins with its
number of shapes; in the new layout, an object begins with its pose and ends with named subframes.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from pathlib import Path

from modular_framework_urdf.rotations import multiply_quaternions, rotate_vector

SIZE_COUNT_OF_SHAPE = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2, "plane": 4}
"""Number of size parameters: box sides; sphere radius; cylinder and cone radius and length [m]; plane a, b, c, d."""

Vector = tuple[float, ...]
NO_COLOR: Vector = (0.0, 0.0, 0.0, 0.0)


class SceneFileError(ValueError):
    """A scene file is invalid."""


@dataclass(frozen=True, slots=True)
class SceneShape:
    """A shape of an object.

    Attributes:
        kind: box, sphere, cylinder, cone, plane or mesh.
        size: Size parameters, see ``SIZE_COUNT_OF_SHAPE``; empty for a mesh.
        position: Position x, y, z in the object frame [m].
        quaternion_xyzw: Orientation in the object frame.
        vertices: Mesh vertices x, y, z [m].
        triangles: Mesh triangles, three indices into ``vertices`` each.
        color: Red, green, blue, alpha in [0, 1]; all 0 for no color.
    """

    kind: str
    size: Vector
    position: Vector
    quaternion_xyzw: Vector
    _: KW_ONLY
    vertices: tuple[Vector, ...] = ()
    triangles: tuple[tuple[int, ...], ...] = ()
    color: Vector = NO_COLOR


@dataclass(frozen=True, slots=True)
class SceneObject:
    """An object of a scene.

    Attributes:
        name: ID of the object.
        position: Position x, y, z in the planning frame [m].
        quaternion_xyzw: Orientation in the planning frame.
        shapes: Shapes of the object.
        subframes: (name, position [m], quaternion_xyzw) of each subframe in the object frame.
    """

    name: str
    position: Vector
    quaternion_xyzw: Vector
    shapes: tuple[SceneShape, ...]
    subframes: tuple[tuple[str, Vector, Vector], ...] = ()

    @property
    def color(self) -> Vector:
        """Color of the first colored shape."""
        return next((shape.color for shape in self.shapes if shape.color != NO_COLOR), NO_COLOR)


@dataclass(frozen=True, slots=True)
class Scene:
    """A scene with its name and its objects in file order."""

    name: str
    objects: tuple[SceneObject, ...]


class _LineReader:
    """Nonempty lines of a file with their line numbers."""

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._lines = [(index, line.strip()) for index, line in enumerate(text.splitlines(), 1) if line.strip()]
        self._next = 0

    def peek(self) -> str:
        return self._lines[self._next][1] if self._next < len(self._lines) else ""

    def next_line(self, expected: str) -> str:
        if self._next >= len(self._lines):
            raise SceneFileError(f"{self._path}: the file ends where {expected} is expected; a scene ends with '.'")
        self._next += 1
        return self._lines[self._next - 1][1]

    def fault(self, expected: str) -> SceneFileError:
        line_number, line = self._lines[self._next - 1]
        return SceneFileError(f"{self._path}:{line_number}: got '{line[:60]}', expected {expected}")

    def numbers(self, count: int, noun: str) -> Vector:
        expected = f"{noun} ({count} finite number{'s' if count > 1 else ''})"
        fields = self.next_line(expected).split()
        try:
            values = tuple(float(field) for field in fields)
        except ValueError as error:
            raise self.fault(expected) from error
        if len(values) != count or not all(map(math.isfinite, values)):
            raise self.fault(expected)
        return values

    def counts(self, count: int, noun: str) -> tuple[int, ...]:
        values = self.numbers(count, noun)
        if any(value < 0 or value != int(value) for value in values):
            raise self.fault(f"{noun} (nonnegative integers)")
        return tuple(int(value) for value in values)

    def quaternion(self, noun: str) -> Vector:
        values = self.numbers(4, noun)
        norm = math.hypot(*values)
        if abs(norm - 1.0) > 1e-2:
            raise self.fault(f"{noun} as a unit quaternion x y z w; the norm is {norm:.4g}")
        return tuple(value / norm for value in values)


def read_scene_file(path: Path) -> Scene:
    """Reads a scene file.

    Raises:
        SceneFileError: The file cannot be read or is not a text scene.
    """
    try:
        lines = _LineReader(path, path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        scene_names = ", ".join(sorted(file.name for file in path.parent.glob("*.scene"))) or "none"
        raise SceneFileError(f"{path}: cannot be read ({error}); scenes in its folder: {scene_names}") from error
    name = lines.next_line("the name of the scene")
    objects: list[SceneObject] = []
    while (line := lines.next_line("an object ('* name') or the end ('.')")) != ".":
        if not line.startswith("* "):
            raise lines.fault("an object ('* name') or the end ('.')")
        body = line[2:].strip()
        if body in {known.name for known in objects}:
            raise lines.fault("a name that no earlier object has")
        objects.append(_read_object(body, lines))
    return Scene(name, tuple(objects))


def _read_object(name: str, lines: _LineReader) -> SceneObject:
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


def _read_shape(lines: _LineReader) -> SceneShape:
    kind = lines.next_line("the kind of a shape")
    vertices: tuple[Vector, ...] = ()
    triangles: tuple[tuple[int, ...], ...] = ()
    size: Vector = ()
    if kind == "mesh":
        vertex_count, triangle_count = lines.counts(2, "the numbers of vertices and triangles")
        vertices = tuple(lines.numbers(3, "a vertex") for _ in range(vertex_count))
        triangles = tuple(_triangle(lines, vertex_count) for _ in range(triangle_count))
    elif kind in SIZE_COUNT_OF_SHAPE:
        size = lines.numbers(SIZE_COUNT_OF_SHAPE[kind], f"the size of a {kind}")
        if kind != "plane" and min(size) <= 0.0:
            raise lines.fault(f"the size of a {kind}, greater than 0")
    else:
        raise lines.fault(f"a kind of shape: {', '.join((*SIZE_COUNT_OF_SHAPE, 'mesh'))}")
    position = lines.numbers(3, f"the position of a {kind}")
    quaternion = lines.quaternion(f"the orientation of a {kind}")
    color = lines.numbers(4, f"the colour of a {kind}")
    if not all(0.0 <= component <= 1.0 for component in color):
        raise lines.fault(f"the colour of a {kind}, red, green, blue and alpha in 0..1")
    return SceneShape(kind, size, position, quaternion, vertices=vertices, triangles=triangles, color=color)


def _triangle(lines: _LineReader, vertex_count: int) -> tuple[int, ...]:
    indices = lines.counts(3, "a triangle")
    if max(indices) >= vertex_count:
        raise lines.fault(f"a triangle of indices below {vertex_count}")
    return indices


def scene_text(scene: Scene, old_layout: bool = False) -> str:
    """Returns a scene as the text of a scene file.

    Args:
        scene: Scene to write.
        old_layout: Whether to write the old layout, without subframes and with object poses merged into shape poses.

    Raises:
        SceneFileError: A name is empty or spans several lines, or the old layout is requested for subframes.
    """
    lines = [_name(scene.name, "scene")]
    for scene_object in scene.objects:
        lines.append(f"* {_name(scene_object.name, 'object')}")
        if old_layout and scene_object.subframes:
            raise SceneFileError(
                f"object '{scene_object.name}': got {len(scene_object.subframes)} subframes, the old layout has "
                "none; write the new layout"
            )
        if not old_layout:
            lines += _pose_lines(scene_object.position, scene_object.quaternion_xyzw)
        lines.append(str(len(scene_object.shapes)))
        for shape in scene_object.shapes:
            lines += _shape_lines(shape, scene_object if old_layout else None)
        if not old_layout:
            lines.append(str(len(scene_object.subframes)))
            for name, position, quaternion in scene_object.subframes:
                lines += [_name(name, "subframe"), *_pose_lines(position, quaternion)]
    return "\n".join([*lines, ".", ""])


def _name(name: str, noun: str) -> str:
    if not name.strip() or len(name.splitlines()) != 1:
        raise SceneFileError(f"name of the {noun}: got '{name}', expected one nonempty line; rename it")
    return name


def _shape_lines(shape: SceneShape, scene_object: SceneObject | None) -> list[str]:
    """Returns the lines of a shape. If an object is given, the shape's pose is transformed by the object's pose."""
    position, quaternion = shape.position, shape.quaternion_xyzw
    if scene_object is not None:
        rotated = rotate_vector(scene_object.quaternion_xyzw, position)
        position = tuple(a + b for a, b in zip(scene_object.position, rotated, strict=True))
        quaternion = multiply_quaternions(scene_object.quaternion_xyzw, quaternion)
    sizes = [_number_text(shape.size)]
    if shape.kind == "mesh":
        sizes = [
            f"{len(shape.vertices)} {len(shape.triangles)}",
            *map(_number_text, shape.vertices),
            *(" ".join(map(str, indices)) for indices in shape.triangles),
        ]
    return [shape.kind, *sizes, *_pose_lines(position, quaternion), _number_text(shape.color)]


def _pose_lines(position: Vector, quaternion_xyzw: Vector) -> list[str]:
    return [_number_text(position), _number_text(quaternion_xyzw)]


def _number_text(values: Vector) -> str:
    return " ".join(f"{value:.12g}" for value in values)
