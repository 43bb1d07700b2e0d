# SPDX-License-Identifier: BSD-3-Clause
"""Computes the mass properties of solid shapes, for links whose file gives none or impossible ones."""

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
    """A shape: mass [kg], centre and moments about the centre, in the frame of the link."""

    mass: float
    centre: Array
    tensor: Array


def inertial_of_shapes(shapes: list[tuple[specs.Collision, float]]) -> specs.Inertial | None:
    """Returns the mass properties of shapes that are filled; where they overlap, both count.

    Args:
        shapes: Shapes of a link, each with its density [kg/m^3].

    Returns:
        None where no shape has a volume.

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
    return specs.Inertial(Pose((x, y, z)), float(mass), _six(tensor))


def with_mass(inertial: specs.Inertial, mass: float) -> specs.Inertial:
    """Returns the same body with another mass [kg]."""
    xx, xy, xz, yy, yz, zz = (value * mass / inertial.mass for value in inertial.inertia)
    return specs.Inertial(inertial.pose, mass, (xx, xy, xz, yy, yz, zz))


def principal_moments(inertia: tuple[float, float, float, float, float, float]) -> tuple[float, float, float]:
    """Returns the moments of inertia about the principal axes, in rising order."""
    xx, xy, xz, yy, yz, zz = inertia
    values = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return (float(values[0]), float(values[1]), float(values[2]))


def is_impossible(moments: tuple[float, float, float], tolerance: float = 0.0) -> bool:
    """Whether no rigid body has such principal moments: the largest one is above the sum of the others.

    Args:
        moments: In any order [kg m^2].
        tolerance: Share by which it may be above that.
    """
    least, middle, largest = sorted(moments)
    return largest > (least + middle) * (1.0 + tolerance)


def along_principal_axes(inertial: specs.Inertial) -> specs.Inertial:
    """Returns the same inertia in a frame of its principal axes."""
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


def _six(tensor: Array) -> tuple[float, float, float, float, float, float]:
    t: Any = tensor.tolist()
    return (t[0][0], t[0][1], t[0][2], t[1][1], t[1][2], t[2][2])


def _part(shape: specs.Collision, density: float) -> _Part:
    volume, centre, per_mass = _solid(shape.geometry)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    rotation = np.array([rotate_vector(shape.pose.quaternion, axis) for axis in axes]).T
    mass = volume * density
    return _Part(mass, np.array(shape.pose.position) + rotation @ centre, mass * rotation @ per_mass @ rotation.T)


def _solid(geometry: specs.Geometry) -> tuple[float, Array, Array]:
    """Returns volume [m^3], centre [m], and moments about it for 1 kg [m^2] of a shape, in its own frame."""
    match geometry:
        case specs.Box(size=(x, y, z)):
            moments = np.diag([y * y + z * z, x * x + z * z, x * x + y * y]) / 12
            return x * y * z, np.zeros(3), moments
        case specs.Cylinder(radius=radius, length=length):
            across = (3 * radius**2 + length**2) / 12
            return math.pi * radius**2 * length, np.zeros(3), np.diag([across, across, radius**2 / 2])
        case specs.Sphere(radius=radius):
            return 4 / 3 * math.pi * radius**3, np.zeros(3), np.eye(3) * 0.4 * radius**2
        case specs.Mesh():
            return _solid_mesh(geometry)
    raise ValueError(f"{type(geometry).__name__} has no volume")


def _solid_mesh(mesh: specs.Mesh) -> tuple[float, Array, Array]:
    import trimesh

    loaded = load_mesh(mesh)
    solid = trimesh.Trimesh(loaded.vertices, loaded.triangles)
    if not solid.is_volume or solid.volume <= 0:  # an open surface encloses nothing: its hull does
        try:
            solid = solid.convex_hull
        except Exception:  # noqa: BLE001 - qhull reports flat point sets by its own exceptions
            return 0.0, np.zeros(3), np.zeros((3, 3))
    volume = float(solid.volume)
    if volume <= 0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    return volume, np.asarray(solid.center_mass), np.asarray(solid.moment_inertia) / volume
