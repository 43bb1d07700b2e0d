# SPDX-License-Identifier: BSD-3-Clause
"""Link paths: lines and circular arcs, with a uniform rotation about a fixed axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.planners.pilz.cartesian_limits import CartesianLimits
from modular_framework_planning.planners.pilz.velocity_profile import TrapezoidalProfile, fastest_profile

RADIUS_TOLERANCE = 0.01  # maximum difference between the distances of start and goal from the centre [m]
MIN_RADIUS = 1.0e-4  # [m]
MIN_SINE = 1.0e-3  # minimum sine of the angle between two directions that span a plane


def _rotated_orientation(start: Transform, rotation_vector: Array, fraction: float) -> Array:
    return start.rotation @ pin.exp3(fraction * rotation_vector)


@dataclass(frozen=True, slots=True, eq=False)
class LinePath:
    """A straight line between two poses.

    Attributes:
        start, end: Link poses in the planning frame.
        rotation_vector: Rotation from start to end as axis times angle, in the start frame [rad].
    """

    start: Transform
    end: Transform
    rotation_vector: Array

    @classmethod
    def between(cls, start: Transform, end: Transform) -> LinePath:
        """Returns the line between two poses."""
        return cls(start, end, pin.log3(start.rotation.T @ end.rotation))

    @property
    def translation_length(self) -> float:
        """Path length of the link origin [m]."""
        return float(np.linalg.norm(self.end.translation - self.start.translation))

    def pose(self, fraction: float) -> Transform:
        """Returns the link pose in the planning frame."""
        return pin.SE3(
            _rotated_orientation(self.start, self.rotation_vector, fraction),
            self.start.translation + fraction * (self.end.translation - self.start.translation),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ArcPath:
    """A circular arc between two poses.

    Attributes:
        start: Link pose at the start, in the planning frame.
        rotation_vector: Rotation from start to end as axis times angle, in the start frame [rad].
        centre: Centre of the circle [m].
        first: Unit vector from the centre to the start.
        second: Unit vector perpendicular to `first`, in the direction of motion.
        angle: Angle of the arc, above 0 [rad].
        start_radius, end_radius: Distances of start and end from the centre [m]; the radius changes linearly.
    """

    start: Transform
    rotation_vector: Array
    centre: Array
    first: Array
    second: Array
    angle: float
    start_radius: float
    end_radius: float

    @property
    def translation_length(self) -> float:
        """Path length of the link origin [m]."""
        return self.angle * max(self.start_radius, self.end_radius)

    def pose(self, fraction: float) -> Transform:
        """Returns the link pose in the planning frame."""
        radius = self.start_radius + fraction * (self.end_radius - self.start_radius)
        angle = fraction * self.angle
        point = self.centre + radius * (np.cos(angle) * self.first + np.sin(angle) * self.second)
        return pin.SE3(_rotated_orientation(self.start, self.rotation_vector, fraction), point)


PosePath = LinePath | ArcPath
"""A path of a link; `fraction` runs from 0 to 1."""


def _invalid_path_error(reason: str) -> PlanningError:
    return PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"CIRC: {reason}")


def _sine(first: Array, second: Array) -> float:
    return float(np.linalg.norm(np.cross(first, second)) / (np.linalg.norm(first) * np.linalg.norm(second)))


def arc_around_centre(start: Transform, end: Transform, centre: Array) -> ArcPath:
    """Returns the shorter arc around a centre.

    Args:
        start: Link pose at the start, in the planning frame.
        end: Link pose at the end, in the planning frame.
        centre: Centre of the circle in the planning frame [m].

    Raises:
        PlanningError: The radii differ, or start, centre and goal are collinear, so that the plane is undefined.
    """
    start_offset, end_offset = start.translation - centre, end.translation - centre
    start_radius, end_radius = float(np.linalg.norm(start_offset)), float(np.linalg.norm(end_offset))
    if min(start_radius, end_radius) < MIN_RADIUS:
        raise _invalid_path_error(
            f"the centre is {min(start_radius, end_radius):.6f} m from start or goal; it must be at least "
            f"{MIN_RADIUS} m away"
        )
    if abs(start_radius - end_radius) > RADIUS_TOLERANCE:
        raise _invalid_path_error(
            f"start is {start_radius:.4f} m from the centre and goal {end_radius:.4f} m; the distances may differ "
            f"by at most {RADIUS_TOLERANCE} m: move the centre"
        )
    if _sine(start_offset, end_offset) < MIN_SINE:
        raise _invalid_path_error(
            "start, centre and goal lie on one line, so the plane of the circle is undefined; "
            "use an interim point for a half circle, or two arcs for a full circle"
        )
    first = start_offset / start_radius
    perpendicular = end_offset - (end_offset @ first) * first
    angle = float(np.arctan2(np.linalg.norm(perpendicular), end_offset @ first))
    return ArcPath(
        start=start,
        rotation_vector=pin.log3(start.rotation.T @ end.rotation),
        centre=centre,
        first=first,
        second=perpendicular / np.linalg.norm(perpendicular),
        angle=angle,
        start_radius=start_radius,
        end_radius=end_radius,
    )


def arc_through_interim(start: Transform, end: Transform, interim: Array) -> ArcPath:
    """Returns the arc from start to goal through an interim point.

    Args:
        start: Link pose at the start, in the planning frame.
        end: Link pose at the end, in the planning frame.
        interim: Point on the arc in the planning frame [m].

    Raises:
        PlanningError: The three points are collinear, or two of them coincide.
    """
    to_interim, to_end = interim - start.translation, end.translation - start.translation
    nearest = min(float(np.linalg.norm(item)) for item in (to_interim, to_end, to_end - to_interim))
    if nearest < MIN_RADIUS or _sine(to_interim, to_end) < MIN_SINE:
        raise _invalid_path_error(
            "start, interim point and goal coincide or lie on one line, so they define no circle; use two arcs "
            "for a full circle"
        )
    normal = np.cross(to_interim, to_end)
    squared_norm = float(normal @ normal)
    to_centre = (
        to_interim @ to_interim * np.cross(to_end, normal) + to_end @ to_end * np.cross(normal, to_interim)
    ) / (2.0 * squared_norm)
    centre = start.translation + to_centre
    radius = float(np.linalg.norm(to_centre))
    first = -to_centre / radius
    second = np.cross(normal / np.sqrt(squared_norm), first)
    end_offset = end.translation - centre
    angle = float(np.arctan2(end_offset @ second, end_offset @ first)) % (2.0 * np.pi)
    return ArcPath(
        start=start,
        rotation_vector=pin.log3(start.rotation.T @ end.rotation),
        centre=centre,
        first=first,
        second=second,
        angle=angle,
        start_radius=radius,
        end_radius=radius,
    )


@dataclass(frozen=True, slots=True, eq=False)
class TimedPath:
    """A link path with a velocity profile."""

    path: PosePath
    profile: TrapezoidalProfile

    @property
    def duration_s(self) -> float:
        """Duration of the motion [s]."""
        return self.profile.duration_s

    @property
    def knots(self) -> Array:
        """Times at which the jerk changes [s]."""
        return self.profile.knots

    def pose(self, time_s: float) -> Transform:
        """Returns the link pose in the planning frame."""
        position = self.profile.sample(np.array([time_s])).position[0]
        return self.path.pose(float(position) / self.profile.distance)


def time_pose_path(
    path: PosePath, limits: CartesianLimits, velocity_scaling: float, acceleration_scaling: float
) -> TimedPath | None:
    """Returns a path with the fastest velocity profile within scaled Cartesian limits, None for an empty path.

    Args:
        path: Path of a link.
        limits: Cartesian limits of the link.
        velocity_scaling: Fraction of the velocity limits, in (0, 1].
        acceleration_scaling: Fraction of the acceleration limits, in (0, 1].
    """
    length = max(path.translation_length, float(np.linalg.norm(path.rotation_vector)) * limits.metres_per_radian)
    if length < 1e-9:
        return None
    return TimedPath(
        path,
        fastest_profile(
            length,
            limits.velocity * velocity_scaling,
            limits.acceleration * acceleration_scaling,
            limits.deceleration * acceleration_scaling,
        ),
    )
