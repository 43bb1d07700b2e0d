# SPDX-License-Identifier: BSD-3-Clause
"""Validation of a received trajectory: joint names, sizes, values and times."""

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
    chunks,
)

MAX_VALUE = 1e9  # shorter segments would have infinite coefficients
_MAX_FAULTS_LISTED = 8
_NOUNS = ("position", "velocity", "acceleration")


def joint_faults(names: Sequence[str], known: Sequence[str], allow_partial: bool) -> str:
    """Returns a description of the faults in the joint names of a trajectory, or "".

    Args:
        names: Received joint names.
        known: Joints of the controller.
        allow_partial: Whether joints may be missing.
    """
    faults = [
        f"unknown joint '{name}' (index {i})" if name else f"the joint name at index {i} is empty"
        for i, name in enumerate(names)
        if name not in known
    ]
    times_named = Counter(names)
    for name in (name for name in times_named if name in known and times_named[name] > 1):
        indices = " and ".join(islice((str(i) for i, other in enumerate(names) if other == name), _MAX_FAULTS_LISTED))
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
    """Drops values beyond the number of joint names, which ros_controllers accepts in goals for some joints.

    Returns:
        The trajectory with one value per joint, and a warning or "".
    """
    count = len(trajectory.joint_names)
    points = trajectory.points
    sent = points.counts[points.counts > 0]
    size = int(sent.max(initial=0))
    if size <= count or sent.min() < size:
        return trajectory, ""
    truncated = TrajectoryPoints(points.times_s, points.values, np.minimum(points.counts, count))
    return (
        replace(trajectory, points=truncated),
        f"points have {size} values each, only the first {count} are used, for: "
        f"{', '.join(trajectory.joint_names)}; send one value per joint",
    )


def check_points(trajectory: JointTrajectory) -> None:
    """Checks sizes, values and times of a trajectory.

    Raises:
        InvalidTrajectoryError: The trajectory is invalid; the message lists faults by point and joint.
    """
    faults = _Faults()
    points, names = trajectory.points, trajectory.joint_names
    for chunk in chunks(len(points)):
        _check_values(faults, points, chunk, names)
    if points and not math.isfinite(points.times_s[0]):
        faults.add(1, iter([f"point 0: time_from_start is {points.times_s[0]:.9g} s; expected a time"]))
    early = np.flatnonzero(~(np.diff(points.times_s) > 0.0))
    faults.add(len(early), (_time_fault(points.times_s, int(index)) for index in early))
    if not abs(trajectory.stamp_s) < float("inf"):
        faults.add(1, iter([f"header stamp is {trajectory.stamp_s}; expected a time, or 0 for now"]))
    if faults.count:
        raise InvalidTrajectoryError(faults.text())


class _Faults:
    """Describes the first faults and counts the others."""

    def __init__(self) -> None:
        self.count = 0
        self._listed: list[str] = []

    def add(self, count: int, texts: Iterator[str]) -> None:
        """Adds `count` faults and takes only the required descriptions from `texts`."""
        self.count += count
        self._listed += islice(texts, _MAX_FAULTS_LISTED - len(self._listed))

    def text(self) -> str:
        """Returns the descriptions in one text."""
        omitted = self.count - len(self._listed)
        return "; ".join(self._listed) + (f"; and {omitted} more" if omitted else "")


def _check_values(faults: _Faults, points: TrajectoryPoints, chunk: slice, names: Sequence[str]) -> None:
    counts = points.counts[chunk]
    is_wrong_size = counts != len(names)
    is_wrong_size[:, 1:] &= counts[:, 1:] > 0
    beyond = ~(np.abs(points.values[chunk]) <= MAX_VALUE) & ~is_wrong_size[:, :, np.newaxis]
    count = int(np.count_nonzero(is_wrong_size)) + int(np.count_nonzero(beyond))
    if count:
        faults.add(count, _value_faults(points, chunk, is_wrong_size, beyond, names))


def _value_faults(
    points: TrajectoryPoints,
    chunk: slice,
    is_wrong_size: NDArray[np.bool_],
    beyond: NDArray[np.bool_],
    names: Sequence[str],
) -> Iterator[str]:
    for i, kind in np.argwhere(is_wrong_size | beyond.any(axis=2)).tolist():
        point, noun = chunk.start + i, _NOUNS[kind]
        if is_wrong_size[i, kind]:
            plural = noun.replace("y", "ie") + "s"
            yield (
                f"point {point}: has {points.counts[point, kind]} {plural}; expected {len(names)}"
                f"{' or none' if kind else ''}, in the order of the joint names"
            )
        for joint in np.flatnonzero(beyond[i, kind]).tolist():
            yield (
                f"point {point}: {noun} of joint '{names[joint]}' (index {joint}) is "
                f"{points.values[point, kind, joint]:.9g}; expected a finite number of at most {MAX_VALUE:.0e} "
                "in size"
            )


def _time_fault(times_s: Array, index: int) -> str:
    return (
        f"point {index + 1}: time_from_start {times_s[index + 1]:.9g} s does not come after {times_s[index]:.9g} s"
        f" of point {index}; times must increase strictly"
    )
