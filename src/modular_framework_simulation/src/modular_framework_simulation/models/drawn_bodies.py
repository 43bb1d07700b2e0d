# SPDX-License-Identifier: BSD-3-Clause
"""Creates triangle meshes of simple shapes with texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_simulation.models.sdf_specs import Colour

_ROUND_SIDES = 64
"""Number of sides of a round shape; the drawn surface deviates by at most 0.12 % of the radius."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class DrawnBody:
    """Triangles with a common appearance.

    Attributes:
        vertices: Vertex positions, shape (n, 3) [m].
        triangles: Vertex indices, shape (m, 3), counter-clockwise seen from outside.
        normals: Vertex normals, shape (n, 3); None for flat triangles.
        uv: Texture coordinates, shape (n, 2), with (0, 0) in the lower left corner; None without a texture.
        colour: Plain colour, or the factor of the texture's colours.
        image: Texture as a Pillow image; None for a plain colour.
    """

    vertices: Array
    triangles: NDArray[np.int64]
    normals: Array | None
    uv: Array | None
    colour: Colour
    image: Any


def drawn_plane(normal: Array, size: tuple[float, float], colour: Colour, image: Any) -> DrawnBody:
    """Creates a rectangle.

    Args:
        normal: Unit normal of the rectangle, shape (3,).
        size: Edge lengths [m].
        colour: Plain colour, or the factor of the texture's colours.
        image: Texture as a Pillow image; None for a plain colour.
    """
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = np.cross(normal, np.cross(helper, normal))
    across /= np.linalg.norm(across)
    up = np.cross(normal, across)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    vertices = corners[:, :1] * size[0] * across + corners[:, 1:] * size[1] * up
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    return DrawnBody(vertices, triangles, np.tile(normal, (4, 1)), corners + 0.5, colour, image)


def drawn_box(size: Array, colour: Colour, image: Any) -> DrawnBody:
    """Creates a box with the texture on each of its six sides.

    Args:
        size: Edge lengths, shape (3,) [m].
        colour: Plain colour, or the factor of the texture's colours.
        image: Texture as a Pillow image; None for a plain colour.
    """
    vertices: list[Array] = []
    triangles, normals, uv = [], [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = side
            extent = (float(size[(axis + 1) % 3]), float(size[(axis + 2) % 3]))
            face = np.zeros((4, 3))
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
            face[:, axis] = side * size[axis] / 2
            face[:, (axis + 1) % 3] = corners[:, 0] * extent[0]
            face[:, (axis + 2) % 3] = corners[:, 1] * extent[1]
            order = np.array([(0, 1, 2), (0, 2, 3)]) + 4 * len(vertices)
            vertices.append(face)
            triangles.append(order if side > 0 else order[:, ::-1])
            normals.append(np.tile(normal, (4, 1)))
            uv.append(corners + 0.5)
    return DrawnBody(
        np.concatenate(vertices),
        np.concatenate(triangles),
        np.concatenate(normals),
        np.concatenate(uv),
        colour,
        image,
    )


def drawn_cylinder(radius: float, length: float, colour: Colour, image: Any) -> DrawnBody:
    """Creates a cylinder along z with the texture around it; duplicate vertices keep the edges sharp.

    Args:
        radius: Cylinder radius [m].
        length: Cylinder length [m].
        colour: Plain colour, or the factor of the texture's colours.
        image: Texture as a Pillow image; None for a plain colour.
    """
    half = length / 2
    outline = [(0.0, -half), (radius, -half), (radius, -half), (radius, half), (radius, half), (0.0, half)]
    return _surface_of_revolution(np.array(outline), colour, image)


def drawn_sphere(radius: float, colour: Colour, image: Any) -> DrawnBody:
    """Creates a sphere with the texture around it.

    Args:
        radius: Sphere radius [m].
        colour: Plain colour, or the factor of the texture's colours.
        image: Texture as a Pillow image; None for a plain colour.
    """
    angles = np.linspace(-np.pi / 2, np.pi / 2, _ROUND_SIDES // 2 + 1)
    body = _surface_of_revolution(np.stack([np.cos(angles), np.sin(angles)], axis=1) * radius, colour, image)
    return replace(body, normals=body.vertices / radius)


def _surface_of_revolution(outline: Array, colour: Colour, image: Any) -> DrawnBody:
    """Creates the surface of revolution about z of an outline of (radius, height) points."""
    angles = np.linspace(0, 2 * np.pi, _ROUND_SIDES + 1)
    low, high = outline[:, 1].min(), outline[:, 1].max()
    vertices = np.array([(r * np.cos(a), r * np.sin(a), z) for r, z in outline for a in angles])
    # Gazebo wraps textures upside down around round shapes.
    uv = np.array([(1 - a / (2 * np.pi), 1 - (z - low) / (high - low)) for _, z in outline for a in angles])
    row = len(angles)
    corners = [(i * row + j, i * row + j + 1) for i in range(len(outline) - 1) for j in range(_ROUND_SIDES)]
    triangles = np.array([t for a, b in corners for t in ((a, b, b + row), (a, b + row, a + row))])
    return DrawnBody(vertices, triangles, None, uv, colour, image)
