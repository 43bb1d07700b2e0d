# SPDX-License-Identifier: BSD-3-Clause
"""How the grasp server moves an EZGripper, without servos."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from modular_framework_core.grasping.grasp_server import GraspCommandError
from modular_framework_core.grasping.ros_manipulator_drivers import Motion as WantedMotion
from modular_framework_drivers.ezgripper.ezgripper_device import EzGripper, GripperState
from modular_framework_drivers.ezgripper.grip import Motion
from modular_framework_drivers.ezgripper.gripper_servos import CLOSED_POSITION
from modular_framework_drivers.ezgripper.gripper_settings import GripperSettings
from modular_framework_drivers.ezgripper.ros_ezgripper_grasp_server import EzGripperManipulator


class ObedientGripper(EzGripper):
    """Is where it is commanded to be at once."""

    def __init__(self) -> None:
        super().__init__(GripperSettings("/nowhere"))
        self._state = replace(self._state, fault="")

    def torque(self) -> int:
        """Of the latest goal."""
        assert self._request.goal is not None
        return self._request.goal.torque

    def state(self) -> GripperState:
        goal = self._request.goal
        assert goal is not None
        reading = replace(self._state.reading, position=goal.position)
        return replace(self._state, stamp_s=time.monotonic(), goal=goal, motion=Motion.REACHED, reading=reading)


class FaultyGripper(ObedientGripper):
    """Has a fault after a goal was given, which is over before anybody looks; the goal is void."""

    def command(self, position: float, torque: int) -> int:
        number = super().command(position, torque)
        self._report("a blink")
        self._state = replace(self._state, fault="")
        return number

    def state(self) -> GripperState:
        return replace(self._state, stamp_s=time.monotonic(), motion=Motion.REACHED)


def test_a_fault_that_came_and_went_between_two_reads_ends_the_motion_with_its_reason() -> None:
    wanted = WantedMotion({"knuckle": 1.0}, {}, 5.0, lambda: False)
    with pytest.raises(GraspCommandError, match="EzGripper: a blink"):
        EzGripperManipulator(FaultyGripper(), "knuckle").move(wanted)


@pytest.mark.parametrize(
    ("target", "expected"), [(-1e-12, 0.0), (CLOSED_POSITION + 1e-12, CLOSED_POSITION), (1.0, 1.0)]
)
def test_a_posture_that_rounding_put_just_outside_the_range_is_its_end(target: float, expected: float) -> None:
    wanted = WantedMotion({"knuckle": target}, {"knuckle": 0.4}, 1.0, lambda: False)
    outcome = EzGripperManipulator(ObedientGripper(), "knuckle").move(wanted)
    assert outcome.positions == {"knuckle": expected}


@pytest.mark.parametrize(("efforts", "torque"), [({}, 400), ({"knuckle": 0.25}, 200)])
def test_a_motion_without_a_bound_has_the_torque_the_gripper_starts_with(
    efforts: dict[str, float], torque: int
) -> None:
    gripper = ObedientGripper()
    EzGripperManipulator(gripper, "knuckle").move(WantedMotion({"knuckle": 1.0}, efforts, 1.0, lambda: False))
    assert gripper.torque() == torque


def test_a_motion_with_no_torque_at_all_is_refused() -> None:
    wanted = WantedMotion({"knuckle": 1.0}, {"knuckle": 0.0}, 1.0, lambda: False)
    with pytest.raises(GraspCommandError, match="effort limit of 0"):
        EzGripperManipulator(ObedientGripper(), "knuckle").move(wanted)
