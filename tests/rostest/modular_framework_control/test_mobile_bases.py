# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of mobile bases as navigation sees them: topics, frames, adjustable settings."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rosgraph
import rospy
from control_msgs.msg import JointTrajectoryControllerState
from controller_manager_msgs.srv import (
    ListControllers,
    LoadController,
    LoadControllerRequest,
    SwitchController,
    UnloadController,
)
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from modular_framework_testing.ros_session import until


def call(name: str, kind: Any, *arguments: Any) -> Any:
    rospy.wait_for_service(f"controller_manager/{name}", 60.0)
    return rospy.ServiceProxy(f"controller_manager/{name}", kind)(*arguments)


class Heard:
    """The messages of a topic since it was subscribed."""

    def __init__(self, topic: str, kind: Any) -> None:
        self.messages: list[Any] = []
        self._subscriber = rospy.Subscriber(topic, kind, self.messages.append)
        self._topic = topic

    def close(self) -> None:
        self._subscriber.unregister()

    def when(self, condition: Callable[[Any], bool], what: str) -> Any:
        """The first message from now on for which something holds."""
        begun = len(self.messages)
        until(lambda: any(map(condition, self.messages[begun:])), f"{self._topic}: {what}", 60.0)
        return next(message for message in self.messages[begun:] if condition(message))


@pytest.fixture(scope="module", autouse=True)
def robot(ros_session: Any) -> Any:
    assert call("load_controller", LoadController, "drive").ok
    assert call("switch_controller", SwitchController, ["drive"], [], 2, False, 0.0).ok
    return ros_session


@pytest.fixture(scope="module")
def odom(robot: Any) -> Iterator[Heard]:
    heard = Heard("drive/odom", Odometry)
    yield heard
    heard.close()


@pytest.fixture(scope="module")
def cmd_vel(robot: Any) -> Iterator[rospy.Publisher]:
    publisher = rospy.Publisher("drive/cmd_vel", Twist, queue_size=1)
    until(publisher.get_num_connections, "drive/cmd_vel has a subscriber")
    yield publisher
    publisher.unregister()


def twist(linear: float, angular: float) -> Twist:
    return Twist(Vector3(linear, 0.0, 0.0), Vector3(0.0, 0.0, angular))


def test_odometry_and_its_frame_are_those_of_the_parameters(odom: Heard) -> None:
    message = odom.when(lambda _: True, "a message")
    assert (message.header.frame_id, message.child_frame_id) == ("map_of_wheels", "base")
    assert [message.pose.covariance[i * 7] for i in range(6)] == [0.001, 0.002, 3.0, 4.0, 5.0, 0.06]
    assert sum(map(abs, message.twist.covariance)) == pytest.approx(2.1)
    frame = Heard("/tf", TFMessage)
    transform = frame.when(lambda m: m.transforms[0].child_frame_id == "base", "the frame of the base").transforms[0]
    frame.close()
    assert transform.header.frame_id == "map_of_wheels"
    assert transform.transform.rotation.w == pytest.approx(1.0)


def test_the_base_drives_a_circle_of_the_radius_that_is_asked_for(odom: Heard, cmd_vel: rospy.Publisher) -> None:
    cmd_vel.publish(twist(0.4, 0.8))
    moving = odom.when(lambda m: m.twist.twist.angular.z > 0.799, "it turns")
    assert moving.twist.twist.linear.x == pytest.approx(0.4, abs=1e-3)
    for _ in range(2):  # the centre of the circle is where it was, wherever on it the base is
        pose = odom.when(lambda m: m.header.stamp > moving.header.stamp, "a later one").pose.pose
        heading = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        assert (pose.position.x, pose.position.y) == pytest.approx(
            (0.5 * math.sin(heading), 0.5 * (1.0 - math.cos(heading))), abs=1e-6
        )
    cmd_vel.publish(twist(0.0, 0.0))
    odom.when(lambda m: m.twist.twist.angular.z == 0.0, "it stands")


def test_what_is_commanded_and_what_the_wheels_do_is_published(cmd_vel: rospy.Publisher) -> None:
    out = Heard("drive/cmd_vel_out", TwistStamped)
    wheels = Heard("drive/wheel_joint_controller_state", JointTrajectoryControllerState)
    cmd_vel.publish(twist(3.0, 0.0))
    assert out.when(lambda m: m.twist.linear.x > 0.0, "it drives").twist.linear.x == 0.5, "its largest velocity"
    state = wheels.when(lambda m: m.actual.velocities[0] > 4.9, "it drives")
    assert state.joint_names == ["left", "right"]
    assert list(state.desired.velocities) == pytest.approx([5.0, 5.0])
    assert math.isnan(state.error.effort[0])
    for number in (math.nan, math.inf):
        cmd_vel.publish(twist(number, 0.0))
        cmd_vel.publish(twist(0.0, number))
    seen = len(out.messages)
    until(lambda: len(out.messages) > seen + 20, "twenty cycles")
    assert {m.twist.linear.x for m in out.messages[seen:]} == {0.5}, "commands that are no numbers changed nothing"
    cmd_vel.publish(twist(0.0, 0.0))
    out.when(lambda m: m.twist.linear.x == 0.0, "it stands")
    out.close()
    wheels.close()


def test_a_second_publisher_brings_the_base_to_rest(cmd_vel: rospy.Publisher, robot: Any) -> None:
    out = Heard("drive/cmd_vel_out", TwistStamped)
    cmd_vel.publish(twist(0.3, 0.0))
    out.when(lambda m: m.twist.linear.x == 0.3, "it drives")
    other = subprocess.Popen(
        ["rostopic", "pub", "-r", "10", "/drive/cmd_vel", "geometry_msgs/Twist", "{linear: {x: 0.1}}"], env=robot.env
    )
    try:
        out.when(lambda m: m.twist.linear.x == 0.0, "it stands")
        assert {m.twist.linear.x for m in out.messages} <= {0.0, 0.3}, "the other never drove it"
    finally:
        other.terminate()
        other.wait()
    until(lambda: "got 2 publishers; expected one" in robot.log(), "the reason in the log")

    def drives() -> bool:
        cmd_vel.publish(twist(0.2, 0.0))
        return bool(out.messages[-1].twist.linear.x == 0.2)

    until(drives, "it drives again once the other has gone", 60.0)
    cmd_vel.publish(twist(0.0, 0.0))
    out.when(lambda m: m.twist.linear.x == 0.0, "it stands")
    out.close()


def test_factors_and_rate_can_be_adjusted_while_it_runs(odom: Heard, cmd_vel: rospy.Publisher) -> None:
    client = Client("drive", timeout=30.0)
    assert {key: value for key, value in client.get_configuration().items() if key != "groups"} == {
        "left_wheel_radius_multiplier": 1.0,
        "right_wheel_radius_multiplier": 1.0,
        "wheel_separation_multiplier": 1.0,
        "publish_rate": 50.0,
        "enable_odom_tf": True,
    }
    applied = client.update_configuration(
        {"left_wheel_radius_multiplier": 0.8, "right_wheel_radius_multiplier": 9.0, "enable_odom_tf": False}
    )
    assert (applied["left_wheel_radius_multiplier"], applied["right_wheel_radius_multiplier"]) == (0.8, 1.5)
    wheels = Heard("drive/wheel_joint_controller_state", JointTrajectoryControllerState)
    cmd_vel.publish(twist(0.12, 0.0))
    state = wheels.when(lambda m: m.desired.velocities[0] > 0.0, "it drives")
    assert list(state.desired.velocities) == pytest.approx([0.12 / 0.08, 0.12 / 0.15])
    refused = client.update_configuration({"wheel_separation_multiplier": math.nan})
    assert refused["wheel_separation_multiplier"] == 1.0
    frame = Heard("/tf", TFMessage)
    seen = len(odom.messages)
    until(lambda: len(odom.messages) > seen + 10, "ten messages of the odometry")
    assert not frame.messages
    cmd_vel.publish(twist(0.0, 0.0))
    wheels.when(lambda m: m.desired.velocities[0] == 0.0, "it stands")
    wheels.close()
    frame.close()


def test_parameters_that_lack_are_an_error_of_the_log(robot: Any) -> None:
    assert not rospy.ServiceProxy("controller_manager/load_controller", LoadController)(
        LoadControllerRequest("broken")
    ).ok
    until(lambda: "/broken/pose_covariance_diagonal: got None; expected six numbers" in robot.log(), "the reason")


def test_nothing_is_left_of_a_controller_that_was_unloaded(robot: Any) -> None:
    assert call("switch_controller", SwitchController, [], ["drive"], 2, False, 0.0).ok
    assert call("unload_controller", UnloadController, "drive").ok
    assert not call("list_controllers", ListControllers).controller
    publishers, subscribers, services = rosgraph.Master("/test").getSystemState()
    left = [
        name
        for names in (publishers, subscribers, services)
        for name, nodes in names
        if name.startswith("/drive/") and any("robot_hw" in node for node in nodes)
    ]
    assert not left
    assert call("load_controller", LoadController, "drive").ok, "it can be loaded again"
