# SPDX-License-Identifier: BSD-3-Clause
"""Checks the points of a trajectory before it is followed: joint names, sizes, numbers and times."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice, pairwise

from modular_framework_control.trajectory.joint_trajectory import (
    InvalidTrajectoryError,
    JointTrajectory,
    TrajectoryPoint,
    parts,
)

# Coefficients of a segment as short as they come stay finite with values up to this.
LARGEST_VALUE = 1e9
_MOST_FAULTS_LISTED = 8


def joint_faults(names: Sequence[str], known: Sequence[str], allow_partial: bool) -> str:
    """Describes what is wrong with the joint names of a trajectory; "" if nothing is.

    Args:
        names: as sent.
        known: joints of the controller.
        allow_partial: whether some of them may be missing.
    """
    faults = [
        f"unknown joint '{name}' (index {i})" if name else f"the joint name at index {i} is empty"
        for i, name in enumerate(names)
        if name not in known
    ]
    times_named = Counter(names)
    for name in (name for name in times_named if name in known and times_named[name] > 1):
        indices = " and ".join(islice((str(i) for i, other in enumerate(names) if other == name), _MOST_FAULTS_LISTED))
        faults.append(f"joint '{name}' is named twice (indices {indices})")
    missing = [name for name in known if name not in names]
    if missing and not (allow_partial and names):
        faults.append(
            f"joints missing: {', '.join(missing)} (allow_partial_joints_goal is {str(allow_partial).lower()})"
        )
    return f"{_joined(iter(faults))}; joints of the controller: {', '.join(known)}" if faults else ""


def drop_surplus_values(trajectory: JointTrajectory) -> tuple[JointTrajectory, str]:
    """Drops values of points beyond the number of named joints, which ros_controllers allows in goals for some joints.

    Returns:
        The trajectory with one value a joint, and what was left out, or "".
    """
    count = len(trajectory.joint_names)
    sizes = {
        len(values)
        for point in trajectory.points
        for values in (point.positions, point.velocities, point.accelerations)
        if values
    }
    if len(sizes) != 1 or max(sizes) <= count:
        return trajectory, ""
    points = [
        TrajectoryPoint(point.time_s, point.positions[:count], point.velocities[:count], point.accelerations[:count])
        for point in trajectory.points
    ]
    return (
        JointTrajectory(trajectory.joint_names, points, trajectory.stamp_s),
        f"points have {max(sizes)} values each, only the first {count} are used, for: "
        f"{', '.join(trajectory.joint_names)}; send one value a joint",
    )


def check_points(trajectory: JointTrajectory) -> None:
    """Checks sizes, numbers and times of a trajectory.

    Raises:
        InvalidTrajectoryError: lists the faults: which point, which joint, what was got, what is allowed.
    """
    faults = _joined(_faults_of(trajectory))
    if faults:
        raise InvalidTrajectoryError(faults)


def _joined(faults: Iterator[str]) -> str:
    """Joins the faults to one text; of very many only the first, and the number of the others."""
    listed = list(islice(faults, _MOST_FAULTS_LISTED))
    more = sum(1 for _ in faults)
    return "; ".join(listed) + (f"; and {more} more" if more else "")


def _faults_of(trajectory: JointTrajectory) -> Iterator[str]:
    points = trajectory.points
    for part in parts(len(points)):
        for number in range(part.start, part.stop):
            for fault in _faults_of_point(points[number], trajectory.joint_names):
                yield f"point {number}: {fault}"
    if points and not math.isfinite(points[0].time_s):
        yield f"point 0: time_from_start is {points[0].time_s:.9g} s; expected a time"
    for number, (before, point) in enumerate(pairwise(points)):
        if not point.time_s > before.time_s:
            yield (
                f"point {number + 1}: time_from_start {point.time_s:.9g} s does not come after {before.time_s:.9g} s"
                f" of point {number}; times must increase strictly"
            )
    if not abs(trajectory.stamp_s) < float("inf"):
        yield f"header stamp is {trajectory.stamp_s}; expected a time, or 0 for now"


def _faults_of_point(point: TrajectoryPoint, names: Sequence[str]) -> Iterator[str]:
    for noun, values, optional in (
        ("position", point.positions, False),
        ("velocity", point.velocities, True),
        ("acceleration", point.accelerations, True),
    ):
        if optional and not values:
            continue
        if len(values) != len(names):
            plural = noun.replace("y", "ie") + "s"
            yield (
                f"has {len(values)} {plural}; expected {len(names)}{' or none' if optional else ''}, in the order "
                "of the joint names"
            )
        elif not all(-LARGEST_VALUE <= value <= LARGEST_VALUE for value in values):
            yield from (
                f"{noun} of joint '{names[i]}' (index {i}) is {value:.9g}; expected a finite number of at most "
                f"{LARGEST_VALUE:.0e} in size"
                for i, value in enumerate(values)
                if not abs(value) <= LARGEST_VALUE
            )
