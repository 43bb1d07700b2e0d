# SPDX-License-Identifier: BSD-3-Clause
"""Checks the points of a trajectory before it is followed: joint names, sizes, numbers and times."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from modular_framework_control.trajectory.joint_trajectory import (
    Array,
    InvalidTrajectoryError,
    JointTrajectory,
    TrajectoryPoints,
    parts,
)

# Coefficients of a segment as short as they come stay finite with values up to this.
LARGEST_VALUE = 1e9
_MOST_FAULTS_LISTED = 8
_NOUNS = ("position", "velocity", "acceleration")


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
    if not faults:
        return ""
    listed = _Faults()
    listed.add(len(faults), iter(faults))
    return f"{listed.text()}; joints of the controller: {', '.join(known)}"


def drop_surplus_values(trajectory: JointTrajectory) -> tuple[JointTrajectory, str]:
    """Drops values of points beyond the number of named joints, which ros_controllers allows in goals for some joints.

    Returns:
        The trajectory with one value a joint, and what was left out, or "".
    """
    count = len(trajectory.joint_names)
    points = trajectory.points
    sent = points.counts[points.counts > 0]
    size = int(sent.max(initial=0))
    if size <= count or sent.min() < size:
        return trajectory, ""
    kept = TrajectoryPoints(points.times_s, points.values, np.minimum(points.counts, count))
    return (
        replace(trajectory, points=kept),
        f"points have {size} values each, only the first {count} are used, for: "
        f"{', '.join(trajectory.joint_names)}; send one value a joint",
    )


def check_points(trajectory: JointTrajectory) -> None:
    """Checks sizes, numbers and times of a trajectory.

    Raises:
        InvalidTrajectoryError: lists the faults: which point, which joint, what was got, what is allowed.
    """
    faults = _Faults()
    points, names = trajectory.points, trajectory.joint_names
    for part in parts(len(points)):
        _check_values(faults, points, part, names)
    if points and not math.isfinite(points.times_s[0]):
        faults.add(1, iter([f"point 0: time_from_start is {points.times_s[0]:.9g} s; expected a time"]))
    early = np.flatnonzero(~(np.diff(points.times_s) > 0.0))
    faults.add(len(early), (_early(points.times_s, int(number)) for number in early))
    if not abs(trajectory.stamp_s) < float("inf"):
        faults.add(1, iter([f"header stamp is {trajectory.stamp_s}; expected a time, or 0 for now"]))
    if faults.count:
        raise InvalidTrajectoryError(faults.text())


class _Faults:
    """Describes the first of very many faults, and counts the others."""

    def __init__(self) -> None:
        self.count = 0
        self._listed: list[str] = []

    def add(self, count: int, texts: Iterator[str]) -> None:
        """Adds `count` faults; `texts` describes them when asked."""
        self.count += count
        self._listed += islice(texts, _MOST_FAULTS_LISTED - len(self._listed))

    def text(self) -> str:
        """Joins the faults to one text."""
        more = self.count - len(self._listed)
        return "; ".join(self._listed) + (f"; and {more} more" if more else "")


def _check_values(faults: _Faults, points: TrajectoryPoints, part: slice, names: Sequence[str]) -> None:
    counts = points.counts[part]
    missized = counts != len(names)
    missized[:, 1:] &= counts[:, 1:] > 0
    beyond = ~(np.abs(points.values[part]) <= LARGEST_VALUE) & ~missized[:, :, np.newaxis]
    count = int(np.count_nonzero(missized)) + int(np.count_nonzero(beyond))
    if count:
        faults.add(count, _value_faults(points, part, missized, beyond, names))


def _value_faults(
    points: TrajectoryPoints, part: slice, missized: NDArray[np.bool_], beyond: NDArray[np.bool_], names: Sequence[str]
) -> Iterator[str]:
    for i, kind in np.argwhere(missized | beyond.any(axis=2)).tolist():
        point, noun = part.start + i, _NOUNS[kind]
        if missized[i, kind]:
            plural = noun.replace("y", "ie") + "s"
            yield (
                f"point {point}: has {points.counts[point, kind]} {plural}; expected {len(names)}"
                f"{' or none' if kind else ''}, in the order of the joint names"
            )
        for joint in np.flatnonzero(beyond[i, kind]).tolist():
            yield (
                f"point {point}: {noun} of joint '{names[joint]}' (index {joint}) is "
                f"{points.values[point, kind, joint]:.9g}; expected a finite number of at most {LARGEST_VALUE:.0e} "
                "in size"
            )


def _early(times_s: Array, number: int) -> str:
    return (
        f"point {number + 1}: time_from_start {times_s[number + 1]:.9g} s does not come after {times_s[number]:.9g} s"
        f" of point {number}; times must increase strictly"
    )
