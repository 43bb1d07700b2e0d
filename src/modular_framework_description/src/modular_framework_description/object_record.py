# SPDX-License-Identifier: BSD-3-Clause
"""What add_object knows of an object, for the files of the model, the check page and the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from modular_framework_core.scene.scene_file import Scene, SceneObject, SceneShape, scene_text
from modular_framework_description.gripper_openings import GripperOpening
from modular_framework_description.object_mesh import ObjectMesh, SolidProperties
from modular_framework_description.stable_poses import StablePose
from modular_framework_simulation.models.sdf_specs import collision_object_id
from modular_framework_urdf.mesh_reader import TriangleMesh

MAX_POSES = 200
"""Maximum number of stable poses in the file; a round object has a pose per triangle."""
IDENTITY = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class ObjectRecord:
    """An object with all computed properties.

    Attributes:
        name: Name of the model.
        source: Name of the mesh file.
        scale: Factor from the unit of the file to metres.
        friction: Coulomb friction coefficient.
        item: Mesh.
        solid: Mass properties.
        parts: Convex parts in the object frame.
        poses: Stable poses, the most probable first.
        grippers: Grippers of the installed robots.
        warnings: Sentences on probable faults.
    """

    name: str
    source: str
    scale: float
    friction: float
    item: ObjectMesh
    solid: SolidProperties
    parts: tuple[TriangleMesh, ...]
    poses: tuple[StablePose, ...]
    grippers: tuple[GripperOpening, ...]
    warnings: tuple[str, ...]

    @property
    def listed_poses(self) -> Sequence[StablePose]:
        """Returns the stable poses in the file."""
        return self.poses[:MAX_POSES]

    def scene(self) -> str:
        """Returns the object as a MoveIt text scene, with its frame at the origin of the planning frame."""
        shapes = tuple(
            SceneShape(
                "mesh",
                (),
                IDENTITY[:3],
                IDENTITY,
                vertices=tuple(map(tuple, part.vertices.tolist())),
                triangles=tuple(map(tuple, part.triangles.tolist())),
            )
            for part in self.parts
        )
        name = collision_object_id(self.name, "link")
        return scene_text(Scene(self.name, (SceneObject(name, IDENTITY[:3], IDENTITY, shapes),)))

    def summary(self) -> dict[str, Any]:
        """Returns the contents of object.yaml."""
        properties = self.solid.properties
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = properties.inertia.tolist()
        return {
            "object": self.name,
            "mesh": self.source,
            "scale": self.scale,
            "watertight": self.item.is_closed and not self.item.repaired,
            "size": _rounded(self.item.sides),
            "volume": float(f"{self.solid.volume:.6g}"),
            "mass": float(f"{properties.mass:.6g}"),
            "friction": self.friction,
            "centre_of_mass": _rounded(properties.centre.tolist()),
            "inertia": {
                name: float(f"{value:.6g}")
                for name, value in zip(
                    ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), (xx, xy, xz, yy, yz, zz), strict=True
                )
            },
            "convex_parts": len(self.parts),
            "stable_poses": [
                {
                    "roll": round(pose.roll, 6),
                    "pitch": round(pose.pitch, 6),
                    "height": round(pose.height, 6),
                    "probability": round(pose.probability, 4),
                }
                for pose in self.listed_poses
            ],
            "warnings": list(self.warnings),
        }


def _rounded(values: Sequence[float]) -> list[float]:
    return [round(value, 6) + 0.0 for value in values]
