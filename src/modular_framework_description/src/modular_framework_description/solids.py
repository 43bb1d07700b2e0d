# SPDX-License-Identifier: BSD-3-Clause
"""Rigid bodies made of boxes, cylinders and spheres: their volume, centre of mass and inertia tensor.

A model file must state mass and inertia; computing both from the same shapes that collide keeps them true.
Lengths in metres, angles in radians, masses in kilograms; every pose is that of a part in the body's frame.
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
    """Return the 3x3 rotation Rz(yaw) Ry(pitch) Rx(roll) of fixed-axis angles [rad]."""
    return np.asarray(Rotation.from_euler("xyz", rpy).as_matrix(), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Part:
    """One convex piece of a body.

    Attributes:
        kind: "box", "cylinder" (axis along z) or "sphere".
        size: (x, y, z) of a box, (radius, length) of a cylinder, (radius,) of a sphere [m].
        xyz: centre of the part in the body's frame [m].
        rpy: fixed-axis rotation of the part in the body's frame [rad].
    """

    kind: str
    size: tuple[float, ...]
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        lengths = {"box": 3, "cylinder": 2, "sphere": 1}
        if self.kind not in lengths:
            raise ValueError(f"part kind: got '{self.kind}', allowed {sorted(lengths)}")
        if len(self.size) != lengths[self.kind] or min(self.size) <= 0.0:
            raise ValueError(f"size of a {self.kind}: got {self.size}, allowed {lengths[self.kind]} positive lengths")

    def mesh(self) -> trimesh.Trimesh:
        """Return the surface of the part in the body's frame (curved faces as fine polygons)."""
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
        name: name of its model folder.
        description: one sentence for model.config.
        mass: [kg]; 0 for a body that never moves.
        parts: the convex pieces it consists of.
        friction: Coulomb coefficient of its surface.
        rolling_friction: resistance to rolling [m]; 0 for shapes that do not roll.
        colour: red, green, blue in [0, 1].
        mesh_name: file name of a visual mesh of the whole body, "" to show the parts themselves.
        centre_offset: how far the centre of mass is from where even filling puts it [m]; the inertia about it stays.
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
        """Return the outer surface of all parts together."""
        meshes = [part.mesh() for part in self.parts]
        return meshes[0] if len(meshes) == 1 else trimesh.boolean.union(meshes, engine="manifold")

    def mass_properties(self) -> MassProperties:
        """Return mass properties: closed form for one part, integrals over the joined surface for several."""
        if len(self.parts) == 1:
            part, rotation = self.parts[0], rotation_from_rpy(self.parts[0].rpy)
            inertia = self.mass * rotation @ unit_inertia(part) @ rotation.T
            return MassProperties(self.mass, np.array(part.xyz) + self.centre_offset, inertia)
        surface = self.mesh()
        surface.density = self.mass / surface.volume
        centre = np.asarray(surface.center_mass) + self.centre_offset
        return MassProperties(self.mass, centre, np.asarray(surface.moment_inertia))


@dataclass(frozen=True, slots=True)
class MassProperties:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2], in the axes of the body."""

    mass: float
    centre: Array
    inertia: Array


def unit_inertia(part: Part) -> Array:
    """Return the inertia about the centre of a solid part of 1 kg, in its own axes [m^2]."""
    match part.kind:
        case "box":
            x, y, z = part.size
            diagonal = [y * y + z * z, x * x + z * z, x * x + y * y]
            return np.diag(diagonal) / 12.0
        case "cylinder":
            radius, length = part.size
            across = (3.0 * radius**2 + length**2) / 12.0
            return np.diag([across, across, radius**2 / 2.0])
        case "sphere":
            return np.eye(3) * 0.4 * part.size[0] ** 2
    raise ValueError(f"part kind: got '{part.kind}', allowed box, cylinder, sphere")


def ring_of_boxes(radius: float, thickness: float, height: float, count: int, z: float) -> tuple[Part, ...]:
    """Return boxes standing in a circle, as the wall of a hollow cylinder.

    Args:
        radius: outer radius, reached by the middle of each outer face [m].
        thickness: of the wall [m].
        height: of the wall [m].
        count: number of boxes; each is 2 % too narrow to meet its neighbours outside, which keeps the joined
            surface free of edges that coincide.
        z: height of the wall's centre in the body's frame [m].
    """
    width = 0.98 * 2.0 * radius * math.tan(math.pi / count)
    middle = radius - thickness / 2.0
    angles = [2.0 * math.pi * index / count for index in range(count)]
    return tuple(
        Part("box", (thickness, width, height), (middle * math.cos(a), middle * math.sin(a), z), (0.0, 0.0, a))
        for a in angles
    )
