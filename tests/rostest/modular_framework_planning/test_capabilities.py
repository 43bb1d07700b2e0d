# SPDX-License-Identifier: BSD-3-Clause
"""Parameters choose the endpoints of move_group, and its optional tf publisher says where the scene's objects are."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
import rosgraph
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import CollisionObject, PlanningScene
from moveit_msgs.srv import ApplyPlanningScene
from shape_msgs.msg import SolidPrimitive
from tf2_msgs.msg import TFMessage


@pytest.fixture(scope="module", autouse=True)
def session(ros_session: Any) -> Iterator[Any]:
    ros_session.wait_for_service("compute_fk", 120.0)
    yield ros_session
    assert ros_session.answers("/move_group"), ros_session.log()


def test_defaults_are_offered_but_for_the_disabled_one(session: Any) -> None:
    session.wait_for_service("clear_octomap", 60.0)
    services = {name for name, _ in rosgraph.Master("/test").getSystemState()[2]}
    assert {
        "/plan_kinematic_path",
        "/compute_ik",
        "/compute_fk",
        "/check_state_validity",
        "/get_planning_scene",
        "/apply_planning_scene",
        "/clear_octomap",
    } <= services
    assert "/query_planner_interface" not in services


def test_an_unknown_capability_is_a_warning_with_the_list_of_known_ones(session: Any) -> None:
    warning = next(
        line for line in session.log().splitlines() if "nobody/Nothing" in line and "unknown capability" in line
    )
    assert "/move_group/capabilities" in warning and "move_group/MoveGroupMoveAction" in warning
    assert "did you mean 'move_group/MoveGroupMoveAction'?" in session.log()


def test_the_tf_publisher_publishes_objects_and_their_subframes() -> None:
    heard: dict[str, Any] = {}
    rospy.Subscriber(
        "/tf", TFMessage, lambda message: heard.update({item.child_frame_id: item for item in message.transforms})
    )
    crate = CollisionObject(
        id="crate",
        primitives=[SolidPrimitive(SolidPrimitive.BOX, [0.1, 0.1, 0.1])],
        primitive_poses=[Pose(Point(0, 0, 0), Quaternion(0, 0, 0, 1))],
        subframe_names=["lid"],
        subframe_poses=[Pose(Point(0, 0, 0.05), Quaternion(0, 0, 0, 1))],
        pose=Pose(Point(0.5, 0.4, 1.5), Quaternion(0, 0, 0, 1)),
    )
    crate.header.frame_id = "world"
    scene = PlanningScene(is_diff=True)
    scene.world.collision_objects = [crate]
    rospy.wait_for_service("apply_planning_scene", 30.0)
    assert rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)(scene).success
    deadline = time.monotonic() + 30.0
    while not {"crate", "crate/lid"} <= set(heard):
        assert time.monotonic() < deadline, f"no frame of the crate within 30 s; heard {sorted(heard)}"
        time.sleep(0.02)
    for name, height in (("crate", 1.5), ("crate/lid", 1.55)):
        place = heard[name].transform.translation
        assert heard[name].header.frame_id == "world"
        assert (place.x, place.y, place.z) == pytest.approx((0.5, 0.4, height))
