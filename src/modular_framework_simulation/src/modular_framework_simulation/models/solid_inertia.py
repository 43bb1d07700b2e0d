# SPDX-License-Identifier: BSD-3-Clause
"""Computes mass properties of solid shapes, for links with missing or impossible mass properties."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import load_mesh
from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf.rotations import quaternion_from_matrix, rotate_vector

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Part:
    """Shape with mass [kg], centre of mass [m] and moments about the centre [kg m^2], in the link frame."""

    mass: float
    centre: Array
    tensor: Array


_EMPTY = _Part(0.0, np.zeros(3), np.zeros((3, 3)))


def inertial_of_shapes(shapes: list[tuple[specs.Collision, float]]) -> specs.Inertial | None:
    """Computes the mass properties of filled shapes; overlapping volumes are counted repeatedly.

    Args:
        shapes: Shapes of a link with their densities [kg/m^3].

    Returns:
        Mass properties in the link frame; None if no shape has a volume.

    Raises:
        DescriptionError: A mesh cannot be read.
    """
    parts = [_part(shape, density) for shape, density in shapes if not isinstance(shape.geometry, specs.Plane)]
    mass = sum(part.mass for part in parts)
    if mass <= 0:
        return None
    centre = sum((part.mass * part.centre for part in parts), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        arm = part.centre - centre
        tensor += part.tensor + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    x, y, z = (float(value) for value in centre)
    return specs.Inertial(Pose((x, y, z)), float(mass), _upper_triangle(tensor))


def with_mass(inertial: specs.Inertial, mass: float) -> specs.Inertial:
    """Returns the mass properties scaled to a mass [kg]."""
    xx, xy, xz, yy, yz, zz = (value * mass / inertial.mass for value in inertial.inertia)
    return specs.Inertial(inertial.pose, mass, (xx, xy, xz, yy, yz, zz))


def principal_moments(inertia: tuple[float, float, float, float, float, float]) -> tuple[float, float, float]:
    """Returns the principal moments of inertia in ascending order [kg m^2]."""
    xx, xy, xz, yy, yz, zz = inertia
    values = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return (float(values[0]), float(values[1]), float(values[2]))


def is_impossible(moments: tuple[float, float, float], tolerance: float = 0.0) -> bool:
    """Returns whether no rigid body has these principal moments: the largest exceeds the sum of the other two.

    Args:
        moments: Principal moments in any order [kg m^2].
        tolerance: Fraction by which the largest moment may exceed the sum.
    """
    smallest, middle, largest = sorted(moments)
    return largest > (smallest + middle) * (1.0 + tolerance)


def along_principal_axes(inertial: specs.Inertial) -> specs.Inertial:
    """Returns the same mass properties with the inertia axes along the principal axes."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    if (xy, xz, yz) == (0.0, 0.0, 0.0):
        return inertial
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    orientation = quaternion_from_matrix(axes.tolist())
    one, two, three = moments.tolist()
    return specs.Inertial(
        inertial.pose @ Pose((0.0, 0.0, 0.0), orientation), inertial.mass, (one, 0.0, 0.0, two, 0.0, three)
    )


def _upper_triangle(tensor: Array) -> tuple[float, float, float, float, float, float]:
    t: Any = tensor.tolist()
    return (t[0][0], t[0][1], t[0][2], t[1][1], t[1][2], t[2][2])


def _part(shape: specs.Collision, density: float) -> _Part:
    solid = _solid(shape.geometry)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    rotation = np.array([rotate_vector(shape.pose.quaternion, axis) for axis in axes]).T
    centre = np.array(shape.pose.position) + rotation @ solid.centre
    return _Part(solid.mass * density, centre, density * rotation @ solid.tensor @ rotation.T)


def _solid(geometry: specs.Geometry) -> _Part:
    """Returns a shape with a density of 1 kg/m^3, in the frame of the shape."""
    match geometry:
        case specs.Box(size=(x, y, z)):
            volume, moments = x * y * z, np.diag([y * y + z * z, x * x + z * z, x * x + y * y]) / 12
        case specs.Cylinder(radius=radius, length=length):
            across = (3 * radius**2 + length**2) / 12
            volume, moments = math.pi * radius**2 * length, np.diag([across, across, radius**2 / 2])
        case specs.Sphere(radius=radius):
            volume, moments = 4 / 3 * math.pi * radius**3, np.eye(3) * 0.4 * radius**2
        case specs.Mesh():
            return _solid_mesh(geometry)
        case _:
            raise ValueError(f"{type(geometry).__name__} has no volume")
    return _Part(volume, np.zeros(3), volume * moments)


def _solid_mesh(mesh: specs.Mesh) -> _Part:
    import trimesh

    loaded = load_mesh(mesh)
    solid = trimesh.Trimesh(loaded.vertices, loaded.triangles)
    if not solid.is_volume or solid.volume <= 0:  # an open surface has no volume, so its hull is used
        try:
            solid = solid.convex_hull
        except Exception:  # noqa: BLE001 - qhull reports flat point sets with its own exceptions
            return _EMPTY
    volume = float(solid.volume)
    return _Part(volume, np.asarray(solid.center_mass), np.asarray(solid.moment_inertia)) if volume > 0 else _EMPTY
