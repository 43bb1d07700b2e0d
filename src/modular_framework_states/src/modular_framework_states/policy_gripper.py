# SPDX-License-Identifier: BSD-3-Clause
"""Moves the manipulator between two postures, by the fraction that a policy returns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modular_framework_core.commander.robot_groups import RobotModelError
from modular_framework_states.grasp_goals import start_stage
from modular_framework_states.manipulator_postures import posture_grasp

MIN_CHANGE = 0.02
"""Change of the fraction from which the fingers move; smaller changes are noise of a network."""


class PolicyGripper:
    """Gripper between an open and a closed posture.

    Args:
        opened: Open posture, {joint: position [rad or m]}.
        closed: Closed posture of the same joints.
        client: Client of the manipulator's action server.
        max_torque: Fraction of the maximum torque.

    Raises:
        RobotModelError: The postures have different joints, or do not differ.
    """

    def __init__(
        self, opened: Mapping[str, float], closed: Mapping[str, float], client: Any, max_torque: float
    ) -> None:
        self._ranges = {joint: (opened[joint], closed[joint]) for joint in opened if joint in closed}
        if set(opened) != set(closed) or not any(first != last for first, last in self._ranges.values()):
            raise RobotModelError(
                f"the open posture has the joints {dict(opened)}, the closed posture {dict(closed)}; both must have "
                "the same joints and differ"
            )
        self._client, self._max_torque = client, max_torque
        self._sent: float | None = None

    @property
    def observed_joint(self) -> str:
        """Joint with the longest motion, whose position gives the fraction."""
        return max(self._ranges, key=lambda joint: abs(self._ranges[joint][1] - self._ranges[joint][0]))

    def fraction_at(self, position: float) -> float:
        """Returns the fraction at a position of the observed joint, from 0 (open) to 1 (closed)."""
        opened, closed = self._ranges[self.observed_joint]
        return min(1.0, max(0.0, (position - opened) / (closed - opened)))

    def move(self, fraction: float) -> None:
        """Starts a motion of the fingers, unless they were sent to nearly the same fraction before.

        Args:
            fraction: From 0 (open) to 1 (closed).

        Raises:
            GraspGoalError: There is no manipulator, or no action server.
        """
        if self._sent is not None and abs(fraction - self._sent) < MIN_CHANGE:
            return
        posture = {joint: opened + fraction * (closed - opened) for joint, (opened, closed) in self._ranges.items()}
        is_closing = fraction > (self._sent or 0.0)
        if self._sent is not None:
            self._client.cancel_goal()
        self._sent = fraction
        start_stage(self._client, "grasp" if is_closing else "pregrasp", posture_grasp(posture, 1.0), self._max_torque)
