# SPDX-License-Identifier: BSD-3-Clause
"""Reads the mesh of an object, refuses unusable meshes, and computes mass properties and convex parts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from modular_framework_description.solids import MassProperties
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts, obj_text
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.solid_inertia import inertial_of_shapes
from modular_framework_urdf.mesh_reader import TriangleMesh, read_mesh

Array = npt.NDArray[np.float64]

MIN_SIDE_M, MAX_SIDE_M = 0.002, 2.0
"""Range of the longest side of an object that a robot arm handles [m]."""
_DIGITS, _WELD_DIGITS = 8, 6
"""Decimal places of coordinates in the files, and of vertices that count as equal in a repair [m]."""
_ROUNDING = 1e-7
"""Products of inertia below this fraction of the largest moment are rounding errors."""
FILE_UNITS = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254}


class ObjectError(ValueError):
    """An object cannot be added; the text has the found and the allowed values, and the remedy."""


@dataclass(frozen=True, slots=True)
class ObjectMesh:
    """Mesh of an object, with the origin at the centre of its bounding box.

    Attributes:
        mesh: Triangles [m].
        is_closed: Whether the triangles enclose a volume.
        repaired: Whether holes were filled or triangles reversed to close the mesh.
        narrowest_m: Shortest side of the smallest box of any orientation around the object [m].
    """

    mesh: TriangleMesh
    is_closed: bool
    repaired: bool
    narrowest_m: float

    @property
    def sides(self) -> tuple[float, float, float]:
        """Returns the lengths of the bounding box along x, y and z [m]."""
        x, y, z = np.ptp(self.mesh.vertices, axis=0).tolist()
        return x, y, z


def read_object_mesh(file: Path, scale: float = 1.0) -> ObjectMesh:
    """Reads and centres the mesh of an object.

    Args:
        file: STL, OBJ, PLY or COLLADA file.
        scale: Factor from the unit of the file to metres.

    Raises:
        MeshError: The file is missing, invalid or empty, or has another format.
        ObjectError: The mesh is flat, or its size is not that of an object for a robot arm.
    """
    if not 0.0 < scale < math.inf:
        raise ObjectError(f"--scale is {scale:g}; allowed: a positive number, such as 0.001 for millimetres")
    read = read_mesh(file, (scale, scale, scale))
    low, high = read.vertices.min(axis=0), read.vertices.max(axis=0)
    _check_size(file, float((high - low).max()), scale)
    mesh = TriangleMesh(np.round(read.vertices - (low + high) / 2, _DIGITS), read.triangles)
    narrowest_m = _narrowest_side(file, mesh)
    solid: Any = trimesh.Trimesh(mesh.vertices, mesh.triangles)
    if solid.is_volume:
        return ObjectMesh(mesh, True, False, narrowest_m)
    _repair(solid)
    if not solid.is_volume:
        return ObjectMesh(mesh, False, False, narrowest_m)
    closed = TriangleMesh(np.asarray(solid.vertices), np.asarray(solid.faces, dtype=np.int64))
    return ObjectMesh(closed, True, True, narrowest_m)


def _repair(solid: Any) -> None:
    """Merges vertices at almost the same position, removes the triangles without area, and fills small holes."""
    solid.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=_WELD_DIGITS)
    faces = np.sort(solid.faces, axis=1)
    solid.update_faces((faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]))
    repair: Any = trimesh.repair
    repair.fill_holes(solid)
    repair.fix_normals(solid)


def _check_size(file: Path, longest_m: float, scale: float) -> None:
    if longest_m == 0.0:
        raise ObjectError(f"{file}: all vertices are at the same point; export the mesh again")
    if MIN_SIDE_M <= longest_m <= MAX_SIDE_M:
        return
    sizes = {unit: longest_m * factor for unit, factor in FILE_UNITS.items()}
    fitting = [
        f"--scale {scale * FILE_UNITS[unit]:g} if the file is in {unit} ({size:.3g} m)"
        for unit, size in sizes.items()
        if MIN_SIDE_M <= size <= MAX_SIDE_M
    ]
    advice = f"give {', or '.join(fitting)}" if fitting else "correct --scale or the unit of the file"
    raise ObjectError(
        f"{file}: the longest side is {longest_m:.4g} m; allowed: {MIN_SIDE_M:g} to {MAX_SIDE_M:g} m; {advice}"
    )


def _narrowest_side(file: Path, mesh: TriangleMesh) -> float:
    bounds: Any = trimesh.bounds
    try:
        hull = trimesh.Trimesh(mesh.vertices, mesh.triangles).convex_hull
        if not hull.volume > 0.0:
            raise ValueError("its convex hull has no volume")
        return float(min(bounds.oriented_bounds(hull)[1]))
    except Exception as error:  # qhull reports flat point sets by its own exceptions
        raise ObjectError(f"{file}: all triangles lie in one plane or on a line; give the mesh of a solid") from error


def write_shapes(item: ObjectMesh, folder: Path, parts: ConvexParts) -> tuple[str, tuple[str, ...]]:
    """Writes the visual mesh and the convex parts, and returns the names of the files.

    Args:
        item: Mesh of the object.
        folder: Existing folder of the files.
        parts: Converter of meshes.

    Raises:
        DescriptionError: The mesh cannot be converted.
    """
    visual = folder / "visual.obj"
    visual.write_text(obj_text(item.mesh), encoding="ascii")
    names = []
    for index, part in enumerate(parts.parts(specs.Mesh(visual))):
        names.append(f"convex_{index:03d}.obj")
        (folder / names[-1]).write_bytes(part.read_bytes())
    return visual.name, tuple(names)


@dataclass(frozen=True, slots=True)
class SolidProperties:
    """Mass properties of an object of uniform density.

    Attributes:
        volume: Volume of the closed mesh, or of the convex parts of an open mesh [m^3].
        properties: Mass, centre of mass and inertia in the object frame.
    """

    volume: float
    properties: MassProperties


def solid_properties(files: Sequence[Path], mass: float | None, density: float | None) -> SolidProperties:
    """Returns the mass properties of the solid that meshes enclose.

    Args:
        files: Closed meshes that do not overlap.
        mass: Mass [kg]; None to compute the mass from the density.
        density: Density [kg/m^3]; not used with a mass.

    Raises:
        DescriptionError: A mesh cannot be read.
        ObjectError: The meshes have no volume.
    """
    shapes = [specs.Collision(file.stem, Pose(), specs.Mesh(file), specs.Friction()) for file in files]
    solid = inertial_of_shapes([(shape, 1.0) for shape in shapes])
    if solid is None:
        raise ObjectError("the mesh has no volume; give the mesh of a solid")
    volume = solid.mass  # at a density of 1 kg/m^3
    weight = mass if mass is not None else volume * (density or 0.0)
    xx, xy, xz, yy, yz, zz = (value * weight / volume for value in solid.inertia)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia[np.abs(inertia) < _ROUNDING * inertia.max()] = 0.0
    return SolidProperties(volume, MassProperties(weight, np.array(solid.pose.position), inertia))
