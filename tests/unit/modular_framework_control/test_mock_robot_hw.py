# SPDX-License-Identifier: BSD-3-Clause
"""Mock hardware follows its commands exactly."""

from __future__ import annotations

import pytest

from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_ros.node_handle import MappingNodeHandle

URDF = """<robot name="r">
<joint name="shoulder" type="revolute"><limit lower="-1" upper="1" velocity="2" effort="10"/></joint>
<joint name="elbow" type="continuous"><limit velocity="3" effort="10"/></joint></robot>"""
PARAMETERS = {
    "robot_description": URDF,
    "hw": {"joints": ["shoulder", "elbow"], "initial_positions": {"shoulder": 0.5}},
    "joint_limits": {"elbow": {"has_position_limits": True, "min_position": -2.0, "max_position": 2.0}},
}


def make_robot_hw() -> MockRobotHW:
    robot_hw = MockRobotHW()
    root = MappingNodeHandle(PARAMETERS)
    assert robot_hw.init(root, root.child("hw"))
    return robot_hw


def test_it_starts_at_the_initial_positions() -> None:
    assert make_robot_hw().get(PositionJointInterface).get_handle("shoulder").position == 0.5


def test_it_is_at_its_command_one_cycle_later() -> None:
    robot_hw = make_robot_hw()
    handle = robot_hw.get(PositionJointInterface).get_handle("shoulder")
    robot_hw.read(0.0, 0.01)
    handle.command = 0.51
    robot_hw.write(0.0, 0.01)
    robot_hw.read(0.01, 0.01)
    assert handle.position == 0.51
    assert handle.velocity == pytest.approx(1.0)


def test_a_joint_moved_steadily_by_cycles_of_different_length_has_a_steady_velocity() -> None:
    robot_hw = make_robot_hw()
    handle = robot_hw.get(PositionJointInterface).get_handle("elbow")
    velocities, time_s = [], 0.0
    for period_s in (0.008, 0.012, 0.004, 0.016, 0.008):
        time_s += period_s
        robot_hw.read(time_s, period_s)
        velocities.append(handle.velocity)
        handle.command = 1.5 * time_s
        robot_hw.write(time_s, period_s)
    assert velocities == pytest.approx([0.0] + [1.5] * 4)


def test_faulty_parameters_are_refused(caplog: pytest.LogCaptureFixture) -> None:
    assert MockRobotHW().init(MappingNodeHandle({}), MappingNodeHandle({}, "/hw")) is False
    assert "/hw/joints" in caplog.text
