# SPDX-License-Identifier: BSD-3-Clause
"""States what can fail with an object: its mesh, its size, its density, and the grippers that cannot hold it."""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_description.gripper_openings import GripperOpening
from modular_framework_description.object_mesh import ObjectMesh, SolidProperties
from modular_framework_description.stable_poses import StablePose

LARGE_M, SMALL_M, THIN_M = 0.5, 0.01, 0.005
"""Longest sides that are unusual for a graspable object, and the smallest thickness that fingers reach around [m]."""
DENSITIES_KG_PER_M3 = (10.0, 22_600.0)
"""Densities of light foam and of osmium [kg/m^3]."""
MAX_PARTS = 60


def object_warnings(
    item: ObjectMesh,
    solid: SolidProperties,
    parts_count: int,
    poses: Sequence[StablePose],
    grippers: Sequence[GripperOpening],
) -> list[str]:
    """Returns a sentence for each property of an object that probably is a fault or an obstacle.

    Args:
        item: Mesh of the object.
        solid: Mass properties.
        parts_count: Number of convex parts.
        poses: Stable poses.
        grippers: Grippers of the installed robots.
    """
    warnings = [*_mesh_warnings(item), *_size_warnings(item, grippers)]
    density = solid.properties.mass / solid.volume
    if not DENSITIES_KG_PER_M3[0] <= density <= DENSITIES_KG_PER_M3[1]:
        warnings.append(
            f"The density is {density:.3g} kg/m^3; usual: {DENSITIES_KG_PER_M3[0]:g} to {DENSITIES_KG_PER_M3[1]:g}. "
            "Check mass and scale. A hollow object needs a mesh with its inner surface."
        )
    if parts_count > MAX_PARTS:
        warnings.append(f"The object has {parts_count} convex parts, which slow the simulation; simplify the mesh.")
    if not poses:
        warnings.append("No stable pose was found; the object rolls on every face.")
    return warnings


def _mesh_warnings(item: ObjectMesh) -> list[str]:
    if not item.is_closed:
        return [
            "The mesh is not watertight. Volume and inertia are those of the convex parts; close the mesh for exact "
            "values."
        ]
    return (
        ["The mesh was not watertight and was repaired: close vertices merged, small holes filled, normals aligned."]
        if item.repaired
        else []
    )


def _size_warnings(item: ObjectMesh, grippers: Sequence[GripperOpening]) -> list[str]:
    warnings, longest_m, narrowest_m = [], max(item.sides), item.narrowest_m
    if longest_m > LARGE_M:
        warnings.append(f"The longest side is {longest_m:.3f} m; if the file is in another unit, give --scale.")
    if longest_m < SMALL_M:
        warnings.append(f"The longest side is {longest_m * 1e3:.1f} mm; if the file is in another unit, give --scale.")
    if narrowest_m < THIN_M:
        warnings.append(
            f"The object is {narrowest_m * 1e3:.1f} mm thin; fingers cannot reach around an object thinner than "
            f"{THIN_M * 1e3:g} mm that lies on a table."
        )
    for gripper in grippers:
        if narrowest_m > gripper.greatest_m:
            warnings.append(
                f"The object is wider than the opening of {gripper.name}: {narrowest_m:.3f} m at its narrowest, and "
                f"the gripper opens to {gripper.greatest_m:.3f} m. Only a rim or handle can be grasped."
            )
        if narrowest_m < gripper.least_m:
            warnings.append(
                f"The object may be too thin for {gripper.name}: {narrowest_m:.3f} m at its narrowest, and the "
                f"gripper closes to {gripper.least_m:.3f} m."
            )
    return warnings
