# SPDX-License-Identifier: BSD-3-Clause
"""What the commander sends to move_group never makes it forget what the gripper holds."""

from __future__ import annotations

import pytest
from moveit_msgs.msg import RobotState
from sensor_msgs.msg import JointState

from modular_framework_core.commander.moveit_requests import robot_state


@pytest.mark.parametrize(
    "state",
    [
        None,
        {"elbow": 1.0},
        JointState(name=["elbow"], position=[1.0]),
        RobotState(joint_state=JointState(name=["elbow"], position=[1.0])),
    ],
)
def test_every_kind_of_start_state_is_a_change_of_the_current_one(state: object) -> None:
    made = robot_state(state)  # type: ignore[arg-type]
    assert made.is_diff
    assert list(made.joint_state.name) == ([] if state is None else ["elbow"])


def test_the_callers_robot_state_stays_as_it_was() -> None:
    given = RobotState()
    robot_state(given)
    assert not given.is_diff
