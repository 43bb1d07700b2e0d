# SPDX-License-Identifier: BSD-3-Clause
"""Triangles of simple shapes, with the places of a picture on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_simulation.models.sdf_specs import Colour

_ROUND = 64
"""Sides of a round shape; its surface is drawn within 0.12 % of its radius."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class DrawnBody:
    """Triangles with one look.

    Attributes:
        vertices: shape (n, 3) [m].
        triangles: indices of vertices, shape (m, 3), counter-clockwise seen from outside.
        normals: of the vertices; None for flat triangles.
        uv: where the vertices are in the picture, (0, 0) its lower left corner; None without a picture.
        colour: what the picture is multiplied with, or the plain colour.
        picture: an image of Pillow; None for a plain colour.
    """

    vertices: Array
    triangles: NDArray[np.int64]
    normals: Array | None
    uv: Array | None
    colour: Colour
    picture: Any


def drawn_plane(normal: Array, size: tuple[float, float], colour: Colour, picture: Any) -> DrawnBody:
    """Returns a rectangle across a normal, as large as it is to be drawn."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    across = np.cross(normal, np.cross(helper, normal))
    across /= np.linalg.norm(across)
    up = np.cross(normal, across)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    vertices = corners[:, :1] * size[0] * across + corners[:, 1:] * size[1] * up
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    return DrawnBody(vertices, triangles, np.tile(normal, (4, 1)), corners + 0.5, colour, picture)


def drawn_box(size: Array, colour: Colour, picture: Any) -> DrawnBody:
    """Returns a box whose six sides all show the picture."""
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
        picture,
    )


def drawn_cylinder(radius: float, length: float, colour: Colour, picture: Any) -> DrawnBody:
    """Returns a cylinder with the picture around it; edges are there twice, for they are sharp."""
    half = length / 2
    outline = [(0.0, -half), (radius, -half), (radius, -half), (radius, half), (radius, half), (0.0, half)]
    return _turned(np.array(outline), colour, picture)


def drawn_sphere(radius: float, colour: Colour, picture: Any) -> DrawnBody:
    """Returns a sphere with the picture around it."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, _ROUND // 2 + 1)
    body = _turned(np.stack([np.cos(angles), np.sin(angles)], axis=1) * radius, colour, picture)
    return replace(body, normals=body.vertices / radius)


def _turned(outline: Array, colour: Colour, picture: Any) -> DrawnBody:
    """Returns the surface that an outline of radius and height makes when it turns about z."""
    turns = np.linspace(0, 2 * np.pi, _ROUND + 1)
    low, high = outline[:, 1].min(), outline[:, 1].max()
    vertices = np.array([(r * np.cos(a), r * np.sin(a), z) for r, z in outline for a in turns])
    # Pictures for round shapes stand on their head, as Gazebo wraps them.
    uv = np.array([(1 - a / (2 * np.pi), 1 - (z - low) / (high - low)) for _, z in outline for a in turns])
    row = len(turns)
    corners = [(i * row + j, i * row + j + 1) for i in range(len(outline) - 1) for j in range(_ROUND)]
    triangles = np.array([t for a, b in corners for t in ((a, b, b + row), (a, b + row, a + row))])
    return DrawnBody(vertices, triangles, None, uv, colour, picture)
