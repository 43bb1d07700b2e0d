# SPDX-License-Identifier: BSD-3-Clause
"""Draws the convex parts and the sharp edges of an object as SVG pictures from three sides and in stable poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from scipy.spatial import ConvexHull, QhullError

from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

FRONT, SIDE, TOP = (
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
)
"""Rows of the views: direction to the right, direction up, direction to the viewer, each in the drawn frame."""
SHARP_RAD = 0.5
"""Angle between two triangles above which their common edge is drawn [rad]."""
MAX_EDGES = 3000
GOLDEN_ANGLE_DEG = 137.508
MARGIN_PX = 12.0


def sharp_edges(mesh: TriangleMesh) -> Array:
    """Returns the ends of the sharp and of the open edges of a mesh, the longest first, shape (n, 2, 3) [m]."""
    solid: Any = trimesh.Trimesh(mesh.vertices, mesh.triangles)
    sharp = solid.face_adjacency_edges[solid.face_adjacency_angles > SHARP_RAD]
    grouping: Any = trimesh.grouping
    single = grouping.group_rows(solid.edges_sorted, require_count=1)
    ends = np.asarray(solid.vertices)[np.vstack([sharp, solid.edges_sorted[single]])]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return np.asarray(ends[np.argsort(-lengths, kind="stable")[:MAX_EDGES]])


def drawing(parts: Sequence[TriangleMesh], edges: Array, view: Array, scale: float, ground: bool = False) -> str:
    """Returns an SVG picture of an object.

    Args:
        parts: Convex parts.
        edges: Edges of the mesh, shape (n, 2, 3) [m].
        view: View with one direction per row, shape (3, 3); see `FRONT`.
        scale: Pixels per metre.
        ground: Whether to draw a line below the object.
    """
    projected = [part.vertices @ view.T for part in parts]
    points = np.vstack(projected)[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = (high - low) * scale + 2 * MARGIN_PX
    offset = MARGIN_PX - low * scale

    def pixels(flat: Array) -> Array:
        moved = flat * scale + offset
        return np.column_stack([moved[:, 0], height - moved[:, 1]])

    lines = []
    for index in np.argsort([part[:, 2].mean() for part in projected], kind="stable"):
        colour = f"hsl({index * GOLDEN_ANGLE_DEG % 360:.0f},55%,62%)"
        lines.append(f'<polygon points="{_text(pixels(_outline(projected[index][:, :2])))}" fill="{colour}"/>')
    ends = (edges @ view.T)[:, :, :2]
    path = "".join(f"M{_text(pixels(end))}" for end in ends)
    lines.append(f'<path d="{path}" fill="none" stroke="#222" stroke-width="0.8"/>')
    if ground:
        lines.append(
            f'<line x1="0" x2="{width:.1f}" y1="{height - MARGIN_PX:.1f}" y2="{height - MARGIN_PX:.1f}" stroke="#777"/>'
        )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.1f} {height:.1f}" fill-opacity="0.75">{"".join(lines)}</svg>'
    )


def _outline(points: Array) -> Array:
    """Returns the corners of the convex hull of points, shape (n, 2)."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # a part that is seen edge-on
        return points


def _text(points: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
