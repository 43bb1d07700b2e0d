# SPDX-License-Identifier: BSD-3-Clause
"""Texts of userdata: short descriptions of messages and values, never a dump and never a fault."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Pose, PoseStamped, Quaternion, Vector3
from moveit_msgs.msg import RobotTrajectory
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import smach
from modular_framework_core.task_runner.userdata_text import MAX_CHARACTERS, WatchedUserdata, userdata_texts, value_text


def trajectory() -> RobotTrajectory:
    points = [JointTrajectoryPoint(time_from_start=rospy.Duration(0.5 * number)) for number in range(5)]
    return RobotTrajectory(joint_trajectory=JointTrajectory(joint_names=["a", "b"], points=points))


def posed(frame: str) -> PoseStamped:
    quarter_turn = Quaternion(0.0, 0.0, 0.5**0.5, 0.5**0.5)
    stamped = PoseStamped(pose=Pose(position=Vector3(0.41234, -0.1, 0.0), orientation=quarter_turn))
    stamped.header.frame_id = frame
    return stamped


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "not set"),
        (True, "yes"),
        (3, "3"),
        (0.123456, "0.1235"),
        ("grasp_3", "grasp_3"),
        ([1, 2.5], "[1, 2.5]"),
        ([], "empty"),
        (list(range(100)), "100 items"),
        ({"width": 0.08}, "width 0.08"),
        (b"1234", "4 bytes"),
        (np.zeros((2, 3)), "array 2 x 3 of float64"),
        (rospy.Duration(1.5), "1.5 s"),
        (String("ready"), "ready"),
        (posed("world"), "position (0.412, -0.100, 0.000); orientation roll 0° pitch 0° yaw 90°, frame world"),
        (JointState(name=["pan", "lift"], position=[0.1, -1.0]), "pan 0.1, lift -1"),
        (trajectory(), "joint_trajectory 5 points, 2.00 s, 2 joints"),
        (RobotTrajectory(), "empty moveit_msgs/RobotTrajectory"),
        (object(), "object"),
    ],
)
def test_a_value_has_a_short_text(value: Any, text: str) -> None:
    assert value_text(value) == text


def test_a_long_text_is_cut() -> None:
    assert len(value_text("x" * 5000)) == MAX_CHARACTERS


def test_a_value_that_contains_itself_or_raises_is_described_too() -> None:
    endless: list[Any] = []
    endless.append(endless)

    class Broken:
        def __getattr__(self, name: str) -> Any:
            raise RuntimeError("no")

    assert value_text(endless) == "[[[[1 items]]]]"
    assert value_text(Broken()) == "Broken"


def test_a_key_without_a_value_is_left_out_and_written_keys_are_kept_though_a_state_cannot_read_them() -> None:
    data = smach.UserData()
    data.given = 2
    view = smach.Remapper(data, ["given", "missing"], ["chosen"])
    assert userdata_texts(view, ["given", "missing"]) == {"given": "2"}
    watched = WatchedUserdata(view)
    watched.chosen = watched.given + 1
    assert "given" in watched and "missing" not in watched
    assert (data.chosen, watched.written_texts(), list(watched.keys())) == (3, {"chosen": "3"}, ["given", "chosen"])
