# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of bases that steer, as navigation sees them: a car, and a rover with four steered wheels."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
import rospy
from controller_manager_msgs.srv import ListControllers, LoadController, SwitchController
from four_wheel_steering_msgs.msg import FourWheelSteering, FourWheelSteeringStamped
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from modular_framework_testing.ros_session import until

WHEELS = ["front_left", "front_right", "rear_left", "rear_right"]


def call(name: str, kind: Any, *arguments: Any) -> Any:
    rospy.wait_for_service(f"controller_manager/{name}", 60.0)
    return rospy.ServiceProxy(f"controller_manager/{name}", kind)(*arguments)


@pytest.fixture(scope="module", autouse=True)
def robot(ros_session: Any) -> Any:
    for name in ("car", "rover"):
        assert call("load_controller", LoadController, name).ok, name
    assert call("switch_controller", SwitchController, ["car", "rover"], [], 2, False, 0.0).ok
    return ros_session


def publisher(topic: str, kind: Any) -> rospy.Publisher:
    made = rospy.Publisher(topic, kind, queue_size=1)
    until(made.get_num_connections, f"{topic} has a subscriber")
    return made


def heard_until(topic: str, kind: Any, condition: Callable[[Any], bool], what: str) -> Any:
    """The first message of a topic for which something holds."""
    messages: list[Any] = []
    subscriber = rospy.Subscriber(topic, kind, messages.append)
    until(lambda: any(map(condition, messages)), f"{topic}: {what}", 60.0)
    subscriber.unregister()
    return next(message for message in messages if condition(message))


def twist(linear: float, angular: float) -> Twist:
    return Twist(Vector3(linear, 0.0, 0.0), Vector3(0.0, 0.0, angular))


def test_a_car_turns_as_its_steering_angle_says() -> None:
    command = publisher("car/cmd_vel", Twist)
    command.publish(twist(0.2, 0.3))
    turn = 0.2 * math.tan(0.3) / 0.4
    message = heard_until("car/odom", Odometry, lambda m: abs(m.twist.twist.angular.z - turn) < 0.02 * turn, "it turns")
    assert message.twist.twist.linear.x == pytest.approx(0.2, rel=0.02)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "car")
    command.publish(twist(math.nan, 0.0))
    command.publish(twist(0.0, 0.0))
    heard_until("car/odom", Odometry, lambda m: m.twist.twist.linear.x == 0.0, "it stands")


def test_a_rover_walks_like_a_crab_and_publishes_its_angles() -> None:
    command = publisher("rover/cmd_four_wheel_steering", FourWheelSteering)
    angle = math.pi / 8.0
    command.publish(FourWheelSteering(speed=0.2, front_steering_angle=angle, rear_steering_angle=angle))
    message = heard_until(
        "rover/odom", Odometry, lambda m: abs(m.twist.twist.linear.y - 0.2 * math.sin(angle)) < 1e-3, "it walks"
    )
    assert message.twist.twist.linear.x == pytest.approx(0.2 * math.cos(angle), abs=1e-3)
    assert message.twist.twist.angular.z == pytest.approx(0.0, abs=1e-6)
    state = heard_until(
        "rover/odom_steer", FourWheelSteeringStamped, lambda m: abs(m.data.speed - 0.2) < 1e-3, "0.2 m/s"
    )
    assert (state.data.front_steering_angle, state.data.rear_steering_angle) == pytest.approx((angle, angle), abs=1e-5)
    assert state.header.frame_id == "odom"
    command.publish(FourWheelSteering(speed=math.nan))
    command.publish(FourWheelSteering())
    heard_until("rover/odom", Odometry, lambda m: m.twist.twist.linear.x == 0.0, "it stands")


def test_a_rover_turns_with_both_axles() -> None:
    command = publisher("rover/cmd_vel", Twist)
    command.publish(twist(0.5, 0.25))
    heard_until("rover/odom", Odometry, lambda m: abs(m.twist.twist.angular.z - 0.25) < 1e-3, "it turns")
    state = heard_until(
        "rover/odom_steer", FourWheelSteeringStamped, lambda m: m.data.front_steering_angle > 0.4, "it steers"
    )
    assert state.data.rear_steering_angle == pytest.approx(-state.data.front_steering_angle, abs=1e-5)
    assert math.tan(state.data.front_steering_angle) == pytest.approx(0.25 * 1.9 / 2.0 / 0.5, rel=1e-3)
    command.publish(twist(0.0, 0.0))
    heard_until("rover/odom", Odometry, lambda m: m.twist.twist.angular.z == 0.0, "it stands")


def test_frames_and_claims_of_both_are_there() -> None:
    for name in ("car", "rover"):
        heard_until("/tf", TFMessage, lambda m, name=name: m.transforms[0].child_frame_id == name, f"the frame {name}")
    claims = {
        entry.name: {claim.hardware_interface: set(claim.resources) for claim in entry.claimed_resources}
        for entry in call("list_controllers", ListControllers).controller
    }
    assert claims["car"] == {
        "hardware_interface::VelocityJointInterface": {"rear_wheel_joint"},
        "hardware_interface::PositionJointInterface": {"front_steer_joint"},
    }
    assert claims["rover"] == {
        "hardware_interface::VelocityJointInterface": set(WHEELS),
        "hardware_interface::PositionJointInterface": {f"s_{name}" for name in WHEELS},
    }
