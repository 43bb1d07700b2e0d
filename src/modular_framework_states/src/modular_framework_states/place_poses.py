# SPDX-License-Identifier: BSD-3-Clause
"""Computes the poses at which an object stands on a surface, from its stable poses and a region of the surface."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from modular_framework_core.grasp_generation.convex_bodies import convex_hull
from modular_framework_urdf.mesh_reader import TriangleMesh

Array = npt.NDArray[np.float64]

DOWN = np.array([0.0, 0.0, -1.0])
FLAT_M = 1.0e-3
"""Distance from the lowest or highest point up to which corners belong to a face [m]."""
YAWS_RAD = tuple(math.radians(angle) for angle in (0, 45, -45, 90, -90, 135, -135, 180))
QUARTERS_RAD = tuple(math.radians(angle) for angle in (0, 90, -90, 180))
POSITIONS = (0.0, -0.6, 0.6)
"""Positions along each axis of a region, as fractions of its half width; the centre comes first."""
UNLIMITED = (-math.inf, math.inf)


class PlaceError(ValueError):
    """The object cannot stand on the support; the text has the found and the allowed values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetRegion:
    """Box in the world frame for the centre of the object.

    Attributes:
        name: Name of the region; "" for the whole surface.
        x: Smallest and largest x [m].
        y: Smallest and largest y [m].
        z: Smallest and largest z [m].
    """

    name: str = ""
    x: tuple[float, float] = UNLIMITED
    y: tuple[float, float] = UNLIMITED
    z: tuple[float, float] = UNLIMITED

    def contains(self, point: Array) -> bool:
        """Returns whether a point of shape (3,) is in the region."""
        spans = (self.x, self.y, self.z)
        return all(low <= value <= high for value, (low, high) in zip(point, spans, strict=True))

    @property
    def label(self) -> str:
        """Returns the region in words, for errors."""
        x, y = (f"{axis} {low:.3f} to {high:.3f}" for axis, (low, high) in (("x", self.x), ("y", self.y)))
        return f"region '{self.name}' ({x}, {y} m)" if self.name else "the whole surface"


def read_region(name: str, regions: Any) -> TargetRegion:
    """Returns a region of the parameter ``/regions``.

    Args:
        name: Name of the region; "" for the whole surface.
        regions: Value of the parameter: {name: {x: [LOW, HIGH], y: [LOW, HIGH], z: [LOW, HIGH]}}; z may be missing.

    Raises:
        PlaceError: The region does not exist or is invalid.
    """
    if not name:
        return TargetRegion()
    known_regions = regions if isinstance(regions, Mapping) else {}
    if name not in known_regions:
        raise PlaceError(f"region '{name}' does not exist; /regions has: {', '.join(sorted(known_regions)) or 'none'}")
    try:
        spans = {axis: (float(low), float(high)) for axis, (low, high) in dict(known_regions[name]).items()}
        region = TargetRegion(name=name, **spans)
    except (TypeError, ValueError) as error:
        example = "{x: [0.1, 0.2], y: [0.4, 0.5]}"
        raise PlaceError(
            f"/regions/{name} is {known_regions[name]!r}; allowed: spans [LOW, HIGH] [m] such as {example}"
        ) from error
    return region


@dataclass(frozen=True, slots=True)
class Face:
    """Horizontal upper face of a support.

    Attributes:
        corners: Corners in the world frame, shape (n, 2) [m].
        edges: Outward unit normal and offset of each edge, shape (m, 3); inside, normal . point + offset <= 0.
        height: Height in the world frame [m].
    """

    corners: Array
    edges: Array
    height: float

    def excess(self, points: Array) -> float:
        """Returns the largest distance by which points of shape (n, 2) leave the face [m]; negative inside."""
        return float((points @ self.edges[:, :2].T + self.edges[:, 2]).max())


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceLimits:
    """Limits of place poses.

    Attributes:
        max_tilt_rad: Largest angle between the vertical and the direction that was vertical at the grasp [rad].
        overhang_m: Distance by which the lower face of the object may leave the supporting face [m].
        gap_m: Height above the face at which the object is released [m].
        aligned: Whether the longest edges of the two faces must be parallel or perpendicular.
    """

    max_tilt_rad: float = math.pi
    overhang_m: float = 0.0
    gap_m: float = 0.0
    aligned: bool = False


FLAT = PlaceLimits()


@dataclass(frozen=True, slots=True)
class PlacePose:
    """Pose of an object on a surface.

    Attributes:
        position: Origin of the object in the world frame, shape (3,) [m].
        rotation: Orientation of the object in the world frame.
    """

    position: Array
    rotation: Rotation


def upper_face(solids: Sequence[TriangleMesh], region: TargetRegion) -> Face:
    """Returns the highest upper face of a support below the centre of a region.

    Args:
        solids: Parts of the support in the world frame.
        region: Region on the support.

    Raises:
        PlaceError: No part has such a face.
    """
    faces = [face for solid in solids if (face := _top(solid.vertices)) is not None]
    centre = np.array([[np.mean(span) if math.isfinite(span[0]) else np.nan for span in (region.x, region.y)]])
    fitting = [face for face in faces if face.height <= region.z[1] and (not region.name or face.excess(centre) <= 0.0)]
    if not fitting:
        heights = ", ".join(f"{height:.3f}" for height in sorted({face.height for face in faces})) or "none"
        raise PlaceError(
            f"{region.label} has no upper face below its centre; heights of the upper faces [m]: {heights}"
        )
    return max(fitting, key=lambda face: face.height)


def _top(vertices: Array) -> Face | None:
    """Returns the upper face of a solid; None if its highest points are no face."""
    height = float(vertices[:, 2].max())
    corners = vertices[vertices[:, 2] > height - FLAT_M, :2]
    edges = _edges(corners)
    return None if edges is None else Face(corners, edges, height)


def _edges(points: Array) -> Array | None:
    """Returns the edges of the convex hull of points in a plane, shape (m, 3); None if they lie on a line."""
    try:
        return ConvexHull(points).equations if len(points) > 2 else None
    except QhullError:
        return None


def stable_directions(solids: Sequence[TriangleMesh]) -> Array:
    """Returns the directions that point down when an object of uniform density stands, shape (n, 3).

    An object stands on a face of its convex hull if its centre of mass is above the face.

    Args:
        solids: Parts of the object in its frame, as closed meshes.
    """
    corners = np.vstack([solid.vertices for solid in solids])
    hull, centre = convex_hull(corners), _centre_of_mass(solids)
    directions = []
    for plane in hull.planes:
        to_down = _shortest_rotation(plane[:3], DOWN)
        face = hull.corners[hull.corners @ plane[:3] + plane[3] > -FLAT_M]
        edges = _edges(to_down.apply(face)[:, :2])
        if edges is not None and np.all(edges[:, :2] @ to_down.apply(centre)[:2] + edges[:, 2] <= 0.0):
            directions.append(plane[:3])
    return np.array(directions).reshape(-1, 3)


def _centre_of_mass(solids: Sequence[TriangleMesh]) -> Array:
    """Returns the centre of mass of closed meshes, shape (3,) [m], as the sum over tetrahedra with the origin."""
    corners = np.concatenate([solid.vertices[solid.triangles] for solid in solids])
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return np.asarray(volumes @ corners.sum(axis=1) / (4.0 * volumes.sum()))


def _shortest_rotation(start: Array, end: Array) -> Rotation:
    return Rotation.align_vectors(end[np.newaxis], start[np.newaxis])[0]


def place_poses(
    solids: Sequence[TriangleMesh],
    held: Rotation,
    face: Face,
    region: TargetRegion,
    limits: PlaceLimits = FLAT,
) -> list[PlacePose]:
    """Returns the poses of an object on a face: first the least tilted, then the most central, then the least rotated.

    Args:
        solids: Parts of the object in its frame.
        held: Orientation of the object in the world frame when it was grasped.
        face: Face that supports the object.
        region: Region for the centre of the object's bounding box.
        limits: Limits of the poses.

    Raises:
        PlaceError: The object has no allowed stable pose, or does not fit.
    """
    corners = convex_hull(np.vstack([solid.vertices for solid in solids])).corners
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
    points, excess, poses = _positions(face, region), [], []
    for upright in _upright(stable_directions(solids), held, limits.max_tilt_rad):
        yaws = _aligned_yaws(_stance(upright, corners - centre).feet, face.corners) if limits.aligned else YAWS_RAD
        stances = [_stance(Rotation.from_euler("z", yaw) * upright, corners - centre) for yaw in yaws]
        height = face.height + stances[0].height
        if not region.z[0] <= height <= region.z[1]:
            excess.append(math.inf)
            continue
        for point, stance in itertools.product(points, stances):
            excess.append(face.excess(stance.feet + point))
            if excess[-1] <= limits.overhang_m + 1.0e-9:
                release = np.array([*point, height + limits.gap_m])
                poses.append(PlacePose(release - stance.rotation.apply(centre), stance.rotation))
    if min(excess) == math.inf:
        low, high = region.z
        raise PlaceError(f"the centre of the object would be at z = {height:.3f} m; allowed: {low:g} to {high:g} m")
    if not poses:
        size, footprint = np.ptp(face.corners, axis=0), np.ptp(stance.feet, axis=0)
        raise PlaceError(
            f"the object's footprint of {footprint[0]:.3f} x {footprint[1]:.3f} m extends beyond the face of "
            f"{size[0]:.3f} x {size[1]:.3f} m by at least {min(excess):.3f} m within {region.label}; "
            f"allowed: {limits.overhang_m:g} m; choose another region or support, or allow more overhang"
        )
    return poses


@dataclass(frozen=True, slots=True)
class _Stance:
    """Orientation in which an object stands.

    Attributes:
        rotation: Orientation in the world frame.
        feet: Lowest corners relative to the centre of the object's bounding box, shape (n, 2) [m].
        height: Height of this centre above the lowest corners [m].
    """

    rotation: Rotation
    feet: Array
    height: float


def _stance(rotation: Rotation, corners: Array) -> _Stance:
    turned = rotation.apply(corners)
    lowest = turned[:, 2].min()
    return _Stance(rotation, turned[turned[:, 2] < lowest + FLAT_M, :2], float(-lowest))


def _aligned_yaws(feet: Array, corners: Array) -> tuple[float, ...]:
    """Returns the rotations that align the longest edges of two faces, the smallest first [rad].

    Args:
        feet: Corners of the lower face of an object, shape (n, 2) [m].
        corners: Corners of the supporting face, shape (m, 2) [m].
    """
    quarter = math.pi / 2
    turn = (_longest_edge_angle(corners) - _longest_edge_angle(feet) + quarter / 2) % quarter - quarter / 2
    return tuple(sorted((turn + yaw for yaw in QUARTERS_RAD), key=abs))


def _longest_edge_angle(points: Array) -> float:
    """Returns the direction of the longest edge of the convex hull of points, shape (n, 2) [rad]."""
    outline = points[ConvexHull(points).vertices]
    edges = np.roll(outline, -1, axis=0) - outline
    x, y = edges[np.argmax(np.linalg.norm(edges, axis=1))]
    return math.atan2(y, x)


def _upright(directions: Array, held: Rotation, max_tilt_rad: float) -> list[Rotation]:
    """Returns the orientations in which the object stands, the least tilted first; raises PlaceError without one."""
    tilts = np.arccos(np.clip(held.apply(directions) @ DOWN, -1.0, 1.0)) if len(directions) else np.zeros(0)
    allowed = [index for index in np.argsort(tilts, kind="stable") if tilts[index] <= max_tilt_rad]
    if not allowed:
        found_text = f"{tilts.min():.2f} rad" if len(tilts) else "no stable pose"
        raise PlaceError(
            f"the object must be tilted by {found_text} to stand; allowed: {max_tilt_rad:g} rad (max_tilt)"
        )
    return [_shortest_rotation(held.apply(directions[index]), DOWN) * held for index in allowed]


def _positions(face: Face, region: TargetRegion) -> list[Array]:
    """Returns positions in the part of a region above a face, the most central first, each of shape (2,) [m]."""
    low = np.maximum(face.corners.min(axis=0), [region.x[0], region.y[0]])
    high = np.minimum(face.corners.max(axis=0), [region.x[1], region.y[1]])
    steps: Iterator[tuple[float, ...]] = itertools.product(POSITIONS, repeat=2)
    return [(low + high) / 2 + (high - low) / 2 * np.array(step) for step in sorted(steps, key=np.linalg.norm)]
