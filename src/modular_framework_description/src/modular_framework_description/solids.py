# SPDX-License-Identifier: BSD-3-Clause
"""Rigid bodies made of boxes, cylinders and spheres, with centre of mass and inertia tensor.

Mass properties are computed from the collision shapes, which keeps them consistent. Lengths are in metres, angles in
radians, masses in kilograms. Poses of parts are in the body frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import trimesh
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]


def rotation_from_rpy(rpy: tuple[float, float, float]) -> Array:
    """Returns the rotation matrix Rz(yaw) Ry(pitch) Rx(roll) of fixed-axis angles [rad], shape (3, 3)."""
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix(), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Part:
    """A convex part of a body.

    Attributes:
        kind: Shape type: "box", "cylinder" (axis along z) or "sphere".
        size: Box (x, y, z), cylinder (radius, length) or sphere (radius,) [m].
        xyz: Centre of the part in the body frame [m].
        rpy: Fixed-axis rotation of the part in the body frame [rad].
    """

    kind: str
    size: tuple[float, ...]
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        counts = {"box": 3, "cylinder": 2, "sphere": 1}
        if self.kind not in counts:
            raise ValueError(f"part kind: got '{self.kind}', allowed {sorted(counts)}")
        if len(self.size) != counts[self.kind] or min(self.size) <= 0.0:
            raise ValueError(f"size of a {self.kind}: got {self.size}, allowed {counts[self.kind]} positive lengths")

    def mesh(self) -> trimesh.Trimesh:
        """Returns the surface of the part in the body frame, with curved faces as fine polygons."""
        match self.kind:
            case "box":
                surface = trimesh.creation.box(extents=self.size)
            case "cylinder":
                surface = trimesh.creation.cylinder(radius=self.size[0], height=self.size[1], sections=64)
            case _:
                surface = trimesh.creation.icosphere(radius=self.size[0], subdivisions=3)
        transform = np.eye(4)
        transform[:3, :3] = rotation_from_rpy(self.rpy)
        transform[:3, 3] = self.xyz
        surface.apply_transform(transform)
        return surface


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body of uniform density.

    Attributes:
        name: Name of the model folder.
        description: Sentence for model.config.
        mass: Mass [kg]; 0 for a static body.
        parts: Convex parts.
        friction: Coulomb friction coefficient.
        rolling_friction: Rolling friction coefficient [m]; 0 for shapes that do not roll.
        colour: Red, green, blue in [0, 1].
        mesh_name: File name of a visual mesh of the whole body; "" to show the parts.
        centre_offset: Offset of the centre of mass from its position at uniform density [m]. The inertia about the
            centre of mass is unchanged.
    """

    name: str
    description: str
    mass: float
    parts: tuple[Part, ...]
    friction: float = 0.8
    rolling_friction: float = 0.0
    colour: tuple[float, float, float] = field(default=(0.7, 0.7, 0.7))
    mesh_name: str = ""
    centre_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def mesh(self) -> trimesh.Trimesh:
        """Returns the outer surface of the union of all parts."""
        meshes = [part.mesh() for part in self.parts]
        return meshes[0] if len(meshes) == 1 else trimesh.boolean.union(meshes, engine="manifold")

    def mass_properties(self) -> MassProperties:
        """Returns the mass properties, in closed form for one part and by surface integrals for several parts."""
        if len(self.parts) == 1:
            part, rotation = self.parts[0], rotation_from_rpy(self.parts[0].rpy)
            inertia = self.mass * rotation @ unit_inertia(part) @ rotation.T
            return MassProperties(self.mass, np.array(part.xyz) + self.centre_offset, inertia)
        surface = self.mesh()
        surface.density = self.mass / surface.volume
        centre = np.asarray(surface.center_mass) + self.centre_offset
        return MassProperties(self.mass, centre, np.asarray(surface.moment_inertia))


@dataclass(frozen=True, slots=True)
class MeshBody:
    """A rigid body whose shapes are files in the folder ``meshes`` of the model.

    Attributes:
        name: Name of the model folder.
        description: Sentence for model.config.
        properties: Mass, centre of mass and inertia in the body axes.
        friction: Coulomb friction coefficient.
        colour: Red, green, blue in [0, 1].
        visual: File of the visual mesh.
        parts: Files of the convex parts.
    """

    name: str
    description: str
    properties: MassProperties
    friction: float
    colour: tuple[float, float, float]
    visual: str
    parts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class MassProperties:
    """Mass properties in the body axes.

    Attributes:
        mass: Mass [kg].
        centre: Centre of mass, shape (3,) [m].
        inertia: Inertia tensor about the centre of mass, shape (3, 3) [kg m^2].
    """

    mass: float
    centre: Array
    inertia: Array


def unit_inertia(part: Part) -> Array:
    """Returns the inertia per mass of a solid part about its centre, in the part axes, shape (3, 3) [m^2]."""
    match part.kind:
        case "box":
            x, y, z = part.size
            diagonal = [y * y + z * z, x * x + z * z, x * x + y * y]
            return np.diag(diagonal) / 12.0
        case "cylinder":
            radius, length = part.size
            transverse = (3.0 * radius**2 + length**2) / 12.0
            return np.diag([transverse, transverse, radius**2 / 2.0])
        case "sphere":
            return np.eye(3) * 0.4 * part.size[0] ** 2
    raise ValueError(f"part kind: got '{part.kind}', allowed box, cylinder, sphere")


def ring_of_boxes(radius: float, thickness: float, height: float, count: int, z: float) -> tuple[Part, ...]:
    """Returns boxes arranged in a circle that form the wall of a hollow cylinder.

    Args:
        radius: Outer radius, at the middle of each outer face [m].
        thickness: Thickness of the wall [m].
        height: Height of the wall [m].
        count: Number of boxes. Each box is 2 % narrower than a closed wall requires, which avoids coincident edges in
            the union.
        z: Height of the wall's centre in the body frame [m].
    """
    width = 0.98 * 2.0 * radius * math.tan(math.pi / count)
    middle = radius - thickness / 2.0
    angles = [2.0 * math.pi * index / count for index in range(count)]
    return tuple(
        Part("box", (thickness, width, height), (middle * math.cos(a), middle * math.sin(a), z), (0.0, 0.0, a))
        for a in angles
    )
