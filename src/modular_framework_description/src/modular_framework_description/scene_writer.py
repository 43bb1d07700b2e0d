# SPDX-License-Identifier: BSD-3-Clause
"""Writes a world as MoveIt's text scene, so that planning on the real robot uses the same obstacles.

The text has the old layout without object poses: shape poses are relative to the world.
"""

from __future__ import annotations

from collections.abc import Iterable

from scipy.spatial.transform import Rotation

from modular_framework_description.sdf_world import PlacedLink, PlacedShape

_NO_COLOUR = "0 0 0 0"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{round(float(value), 9) + 0.0:.9g}" for value in values)


def _shape_lines(shape: PlacedShape) -> list[str]:
    quaternion_xyzw = Rotation.from_matrix(shape.pose[:3, :3]).as_quat(canonical=True)
    # A scene's plane is a x + b y + c z + d = 0 in its own frame, whose pose includes the distance, so d is 0.
    size = (*shape.size, 0.0) if shape.kind == "plane" else shape.size
    return [shape.kind, _numbers(size), _numbers(shape.pose[:3, 3]), _numbers(quaternion_xyzw), _NO_COLOUR]


def scene_text(name: str, links: Iterable[PlacedLink]) -> str:
    """Returns the text of a scene.

    Args:
        name: Name of the scene.
        links: Links in the scene; links without shapes are omitted.
    """
    lines = [name]
    for link in links:
        if link.shapes:
            lines += [f"* {link.object_id}", str(len(link.shapes))]
            for shape in link.shapes:
                lines += _shape_lines(shape)
    return "\n".join([*lines, ".", ""])
