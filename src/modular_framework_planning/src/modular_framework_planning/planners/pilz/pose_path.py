# SPDX-License-Identifier: BSD-3-Clause
"""Paths of a link in space: lines and circular arcs, along which the orientation turns evenly about one axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.planners.pilz.cartesian_limits import CartesianLimits
from modular_framework_planning.planners.pilz.velocity_profile import TrapezoidalProfile, fastest_profile

SAME_RADIUS = 0.01  # [m]; how much the distances of start and goal from a given centre may differ
SMALLEST_RADIUS = 1.0e-4  # [m]
SMALLEST_SINE = 1.0e-3  # of the angle between two directions that are to span a plane


def _turned(start: Transform, turn: Array, share: float) -> Array:
    return start.rotation @ pin.exp3(share * turn)


@dataclass(frozen=True, slots=True, eq=False)
class LinePath:
    """A straight line between two poses.

    Attributes:
        turn: whole rotation as axis times angle [rad], in the frame of the start.
    """

    start: Transform
    end: Transform
    turn: Array

    @classmethod
    def between(cls, start: Transform, end: Transform) -> LinePath:
        """Builds the line."""
        return cls(start, end, pin.log3(start.rotation.T @ end.rotation))

    @property
    def translation_length(self) -> float:
        """Length of the origin's way [m]."""
        return float(np.linalg.norm(self.end.translation - self.start.translation))

    def pose(self, share: float) -> Transform:
        """Returns the link's pose in the planning frame."""
        return pin.SE3(
            _turned(self.start, self.turn, share),
            self.start.translation + share * (self.end.translation - self.start.translation),
        )


@dataclass(frozen=True, slots=True, eq=False)
class ArcPath:
    """A circular arc between two poses.

    Attributes:
        turn: whole rotation as axis times angle [rad], in the frame of the start.
        centre: of the circle [m].
        first, second: unit vectors towards the start and, at a right angle to it, in the direction of motion.
        angle: of the arc, above 0 [rad].
        start_radius, end_radius: equal but for what a given centre is off [m]; the radius changes evenly.
    """

    start: Transform
    turn: Array
    centre: Array
    first: Array
    second: Array
    angle: float
    start_radius: float
    end_radius: float

    @property
    def translation_length(self) -> float:
        """Length of the origin's way [m]."""
        return self.angle * max(self.start_radius, self.end_radius)

    def pose(self, share: float) -> Transform:
        """Returns the link's pose in the planning frame."""
        radius = self.start_radius + share * (self.end_radius - self.start_radius)
        angle = share * self.angle
        point = self.centre + radius * (np.cos(angle) * self.first + np.sin(angle) * self.second)
        return pin.SE3(_turned(self.start, self.turn, share), point)


PosePath = LinePath | ArcPath
"""A path of a link; `share` runs from 0 to 1."""


def _invalid(reason: str) -> PlanningError:
    return PlanningError(ErrorCode.INVALID_MOTION_PLAN, f"CIRC: {reason}")


def _sine(first: Array, second: Array) -> float:
    return float(np.linalg.norm(np.cross(first, second)) / (np.linalg.norm(first) * np.linalg.norm(second)))


def arc_around_centre(start: Transform, end: Transform, centre: Array) -> ArcPath:
    """Returns the shorter arc around a centre.

    Raises:
        PlanningError: the radii differ, or start, centre and goal lie on one line: a half circle has no one plane.
    """
    out, back = start.translation - centre, end.translation - centre
    start_radius, end_radius = float(np.linalg.norm(out)), float(np.linalg.norm(back))
    if min(start_radius, end_radius) < SMALLEST_RADIUS:
        raise _invalid(
            f"the centre is {min(start_radius, end_radius):.6f} m from start or goal; at least "
            f"{SMALLEST_RADIUS} m is needed"
        )
    if abs(start_radius - end_radius) > SAME_RADIUS:
        raise _invalid(
            f"start is {start_radius:.4f} m from the centre and goal {end_radius:.4f} m; they may differ "
            f"by {SAME_RADIUS} m: move the centre"
        )
    if _sine(out, back) < SMALLEST_SINE:
        raise _invalid(
            "start, centre and goal lie on one line, so the circle's plane is unknown; a centre cannot "
            "give a half or a full circle: use an interim point, or two arcs"
        )
    first = out / start_radius
    across = back - (back @ first) * first
    angle = float(np.arctan2(np.linalg.norm(across), back @ first))
    return ArcPath(
        start,
        pin.log3(start.rotation.T @ end.rotation),
        centre,
        first,
        across / np.linalg.norm(across),
        angle,
        start_radius,
        end_radius,
    )


def arc_through_interim(start: Transform, end: Transform, interim: Array) -> ArcPath:
    """Returns the arc from start to goal that passes an interim point.

    Raises:
        PlanningError: the three points lie on one line or two of them coincide: no circle, or a full one.
    """
    to_interim, to_end = interim - start.translation, end.translation - start.translation
    nearest = min(float(np.linalg.norm(item)) for item in (to_interim, to_end, to_end - to_interim))
    if nearest < SMALLEST_RADIUS or _sine(to_interim, to_end) < SMALLEST_SINE:
        raise _invalid(
            "start, interim point and goal coincide or lie on one line, so they give no circle; a full "
            "circle needs two arcs"
        )
    normal = np.cross(to_interim, to_end)
    square = float(normal @ normal)
    shift = (to_interim @ to_interim * np.cross(to_end, normal) + to_end @ to_end * np.cross(normal, to_interim)) / (
        2.0 * square
    )
    centre = start.translation + shift
    radius = float(np.linalg.norm(shift))
    first = -shift / radius
    second = np.cross(normal / np.sqrt(square), first)
    back = end.translation - centre
    angle = float(np.arctan2(back @ second, back @ first)) % (2.0 * np.pi)
    return ArcPath(start, pin.log3(start.rotation.T @ end.rotation), centre, first, second, angle, radius, radius)


@dataclass(frozen=True, slots=True, eq=False)
class TimedPath:
    """A path with a velocity profile: the motion of a link over time."""

    path: PosePath
    profile: TrapezoidalProfile

    @property
    def duration_s(self) -> float:
        """Length of the motion."""
        return self.profile.duration_s

    @property
    def knots(self) -> Array:
        """Times at which the jerk changes."""
        return self.profile.knots

    def pose(self, time_s: float) -> Transform:
        """Returns the link's pose in the planning frame."""
        position = self.profile.at(np.array([time_s]))[0][0]
        return self.path.pose(float(position) / self.profile.distance)


def timed(
    path: PosePath, limits: CartesianLimits, velocity_scaling: float, acceleration_scaling: float
) -> TimedPath | None:
    """Gives a path the fastest trapezoid within scaled Cartesian limits; None where it has no length."""
    length = max(path.translation_length, float(np.linalg.norm(path.turn)) * limits.metres_per_radian)
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
