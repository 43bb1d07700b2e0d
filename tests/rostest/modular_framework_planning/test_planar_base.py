# SPDX-License-Identifier: BSD-3-Clause
"""An arm on a planar base: clients name its variables, states of the SRDF place it, and a marker in RViz drags it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import moveit_commander
import numpy as np
import pytest
import rospy
import tf2_ros
from fake_panda import FAKE_PANDA, fast_panda_arm
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, TransformStamped, Vector3
from moveit_commander import MoveGroupCommander, MoveItCommanderException, RobotCommander
from moveit_msgs.msg import DisplayTrajectory, RobotState
from moveit_msgs.srv import GetPositionFK
from std_msgs.msg import Header
from visualization_msgs.msg import (
    InteractiveMarkerControl,
    InteractiveMarkerFeedback,
    InteractiveMarkerInit,
    InteractiveMarkerUpdate,
)

from modular_framework_testing.ros_session import until

MOBILE = """<group name="mobile"><joint name="virtual_joint"/><group name="panda_arm"/></group>
<group_state name="dock" group="mobile"><joint name="virtual_joint" value="1.5 -0.5 0.6"/>
  <joint name="panda_joint1" value="0.5"/></group_state>"""
VARIABLES = ["virtual_joint/x", "virtual_joint/y", "virtual_joint/theta"]
SEEN = [1.0, 2.0, 0.7]
LAUNCH = f"""<launch>
{FAKE_PANDA}  <param name="robot_description_semantic" value={{srdf}}/>
  <include file="$(find modular_framework_planning)/launch/interactive_goal.launch">
    <arg name="group" value="mobile"/>
    <arg name="velocity_scaling" value="1.0"/>
    <arg name="acceleration_scaling" value="1.0"/>
  </include>
</launch>"""


@pytest.fixture(scope="module")
def base(ros_session: Any) -> Iterator[None]:
    """Publishes where the base is."""
    broadcaster = tf2_ros.TransformBroadcaster()
    x, y, theta = SEEN
    turn = Quaternion(0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0))
    stamped = TransformStamped(Header(frame_id="world"), "panda_link0", Transform(Vector3(x, y, 0.0), turn))

    def send(_event: Any = None) -> None:
        stamped.header.stamp = rospy.Time.now()
        broadcaster.sendTransform(stamped)

    timer = rospy.Timer(rospy.Duration(0.02), send)
    yield
    timer.shutdown()


@pytest.fixture(scope="module")
def mobile(user_packages: Path, ros_launch: Callable[..., Any], base: None) -> Iterator[MoveGroupCommander]:
    text = (user_packages / "panda_moveit_config/config/panda.srdf").read_text()
    planar = text.replace('name="virtual_joint" type="fixed"', 'name="virtual_joint" type="planar"')
    planar = planar.replace("<end_effector", f"{MOBILE}<end_effector", 1)
    session = ros_launch(LAUNCH.format(srdf=quoteattr(planar)))
    fast_panda_arm(session)
    group = MoveGroupCommander("mobile", wait_for_servers=30.0)
    until(lambda: group.get_current_joint_values()[:3] == pytest.approx(SEEN), "the base on tf")
    yield group
    assert session.alive(), session.log()
    moveit_commander.roscpp_shutdown()


def goal_of_base(group: MoveGroupCommander) -> list[float]:
    return group.get_joint_value_target()[:3]


def end_of(motion: Any) -> list[float]:
    """Where a motion leaves the base: x, y, heading."""
    base = motion.multi_dof_joint_trajectory
    assert base.joint_names == ["virtual_joint"]
    t, q = base.points[-1].transforms[0].translation, base.points[-1].transforms[0].rotation
    return [t.x, t.y, 2.0 * math.atan2(q.z, q.w)]


def test_the_base_is_one_joint_of_the_group_with_three_variables(mobile: MoveGroupCommander) -> None:
    assert mobile.get_active_joints() == ["virtual_joint", *(f"panda_joint{n}" for n in range(1, 8))]
    assert mobile.get_variable_names()[:3] == VARIABLES and mobile.get_variable_count() == 10
    robot = RobotCommander()
    assert "virtual_joint" in robot.get_active_joint_names()
    joint = robot.get_joint("virtual_joint")
    assert joint.variable_count() == 3 and joint.value() == pytest.approx(SEEN)
    assert joint.bounds() == [[-math.inf, math.inf]] * 2 + [[-math.pi, math.pi]]
    assert joint.min_bound() == [-math.inf, -math.inf, -math.pi]


def test_the_present_place_of_the_base_is_among_the_values(mobile: MoveGroupCommander) -> None:
    values = RobotCommander().get_current_variable_values()
    assert [values[name] for name in VARIABLES] == pytest.approx(SEEN)
    state = mobile.get_current_state()
    assert state.multi_dof_joint_state.joint_names == ["virtual_joint"]
    assert not set(VARIABLES) & set(state.joint_state.name)


def test_a_target_names_the_base_as_a_joint_or_by_its_variables(mobile: MoveGroupCommander) -> None:
    mobile.set_joint_value_target(mobile.get_current_joint_values())
    assert goal_of_base(mobile) == pytest.approx(SEEN)
    mobile.set_joint_value_target("virtual_joint", [0.5, 0.25, -0.3])
    assert goal_of_base(mobile) == [0.5, 0.25, -0.3]
    mobile.set_joint_value_target({"virtual_joint/y": 1.0, "panda_joint1": 0.1})
    assert goal_of_base(mobile) == [0.5, 1.0, -0.3]
    mobile.set_joint_value_target("virtual_joint/x", 0.75)
    assert goal_of_base(mobile) == [0.75, 1.0, -0.3]
    with pytest.raises(MoveItCommanderException, match="3 variables .*virtual_joint/theta.*got 1 values"):
        mobile.set_joint_value_target("virtual_joint", 0.5)
    assert goal_of_base(mobile) == [0.75, 1.0, -0.3], "a refused target changes nothing"


def test_a_state_of_the_srdf_places_the_base_and_is_planned_to(mobile: MoveGroupCommander) -> None:
    assert mobile.get_named_target_values("dock") == dict(
        zip([*VARIABLES, "panda_joint1"], [1.5, -0.5, 0.6, 0.5], strict=True)
    )
    mobile.set_joint_value_target(mobile.get_current_joint_values())
    mobile.set_named_target("dock")
    worked, motion, _, _ = mobile.plan()
    assert worked and end_of(motion) == pytest.approx([1.5, -0.5, 0.6], abs=1e-3)
    arm = dict(zip(motion.joint_trajectory.joint_names, motion.joint_trajectory.points[-1].positions, strict=True))
    assert arm["panda_joint1"] == pytest.approx(0.5, abs=1e-3)


def test_a_random_target_turns_the_base_and_leaves_it_where_nothing_bounds_it(mobile: MoveGroupCommander) -> None:
    mobile.set_random_target()
    x, y, theta = goal_of_base(mobile)
    assert (x, y) == (0.0, 0.0) and -math.pi <= theta <= math.pi


class Rviz:
    """What RViz knows of the two markers, and its feedback."""

    def __init__(self) -> None:
        self.markers: dict[str, Any] = {}
        self.moved: dict[str, Pose] = {}
        self.motions: list[DisplayTrajectory] = []
        topic = "/interactive_goal/marker"
        rospy.Subscriber(f"{topic}/update_full", InteractiveMarkerInit, self._on_markers)
        rospy.Subscriber(f"{topic}/update", InteractiveMarkerUpdate, self._on_update)
        rospy.Subscriber("/move_group/display_planned_path", DisplayTrajectory, self.motions.append)
        self._feedback = rospy.Publisher(f"{topic}/feedback", InteractiveMarkerFeedback, queue_size=10)
        until(lambda: set(self.markers) == {"goal", "base"}, "the markers", 60.0)
        until(self._feedback.get_num_connections, "the marker's ears")
        time.sleep(1.0)  # a marker server takes feedback of a second client as a conflict during the first second

    def _on_markers(self, message: InteractiveMarkerInit) -> None:
        self.markers = {marker.name: marker for marker in message.markers}

    def _on_update(self, message: InteractiveMarkerUpdate) -> None:
        self.moved.update({item.name: item.pose for item in message.poses})

    def say(self, marker: str, **fields: Any) -> None:
        message = InteractiveMarkerFeedback(client_id="rviz", marker_name=marker, **fields)
        message.header.frame_id = "world"
        self._feedback.publish(message)


def tip_at(mobile: MoveGroupCommander, place: list[float]) -> list[float]:
    """Where the tip is when the base is at a place and the arm as it is."""
    state = mobile.get_current_state()
    x, y, theta = place
    turn = Quaternion(0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0))
    state.multi_dof_joint_state.transforms = [Transform(Vector3(x, y, 0.0), turn)]
    answer = rospy.ServiceProxy("compute_fk", GetPositionFK)(
        Header(),
        ["panda_link8"],
        RobotState(joint_state=state.joint_state, multi_dof_joint_state=state.multi_dof_joint_state, is_diff=True),
    )
    p = answer.pose_stamped[0].pose.position
    return [p.x, p.y, p.z]


def is_near(pose: Pose, place: list[float]) -> bool:
    p = pose.position
    return bool(np.allclose([p.x, p.y, p.z], place, atol=2e-3))


def test_a_marker_on_the_ground_places_the_base_and_takes_the_tip_along(mobile: MoveGroupCommander) -> None:
    rviz, place = Rviz(), [2.0, 1.0, -0.4]
    # joint_state_publisher shows zeros until it knows the initial positions of the fake controllers
    until(lambda: is_near(rviz.markers["goal"].pose, tip_at(mobile, SEEN)), "the tip's marker where the robot is")
    ways = {control.name: control.interaction_mode for control in rviz.markers["base"].controls}
    assert ways.pop("menu") == InteractiveMarkerControl.MENU
    assert ways == {
        "move_x": InteractiveMarkerControl.MOVE_AXIS,
        "move_y": InteractiveMarkerControl.MOVE_AXIS,
        "move_plane": InteractiveMarkerControl.MOVE_PLANE,
        "rotate_z": InteractiveMarkerControl.ROTATE_AXIS,
    }
    at = rviz.markers["base"].pose.position
    assert [at.x, at.y, at.z] == pytest.approx([*SEEN[:2], 0.0], abs=1e-6)
    x, y, theta = place
    turn = Quaternion(0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0))
    rviz.say("base", event_type=InteractiveMarkerFeedback.POSE_UPDATE, pose=Pose(Point(x, y, 0.3), turn))

    until(
        lambda: "goal" in rviz.moved and is_near(rviz.moved["goal"], tip_at(mobile, place)),
        "the tip's marker beside the base",
    )
    assert rviz.moved["base"].position.z == 0.0, "a planar base stays on the ground"
    entry = next(item for item in rviz.markers["base"].menu_entries if item.title == "Plan")
    rviz.motions.clear()  # the topic keeps the motion of the test before
    rviz.say("base", event_type=InteractiveMarkerFeedback.MENU_SELECT, menu_entry_id=entry.id, pose=Pose())
    until(lambda: rviz.motions, "the planned motion on display", 60.0)
    assert end_of(rviz.motions[-1].trajectory[0]) == pytest.approx(place, abs=1e-3)


def test_a_dragged_tip_may_take_the_base_along(mobile: MoveGroupCommander) -> None:
    rviz = Rviz()
    pose = Pose(Point(*tip_at(mobile, [0.0, -2.0, 0.0])), Quaternion(1.0, 0.0, 0.0, 0.0))
    rviz.say("goal", event_type=InteractiveMarkerFeedback.POSE_UPDATE, pose=pose)
    until(lambda: "base" in rviz.moved, "the base's marker near the goal")
    p = rviz.moved["base"].position
    assert math.hypot(p.x - pose.position.x, p.y - pose.position.y) < 1.2, "within reach of the arm"
