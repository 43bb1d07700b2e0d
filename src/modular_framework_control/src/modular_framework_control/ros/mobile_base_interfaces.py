# SPDX-License-Identifier: BSD-3-Clause
"""Opens the topics and dynamic_reconfigure servers of mobile base controllers under the names of ros_controllers."""

from __future__ import annotations

import math
from typing import Any

import rospy
from control_msgs.msg import JointTrajectoryControllerState
from geometry_msgs.msg import Quaternion, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from modular_framework_control.controller_interface.controller import ControllerError
from modular_framework_control.mobile_base.diff_drive_controller import DiffDriveController, WheelState
from modular_framework_control.mobile_base.four_wheel_steering_controller import (
    FourWheelSteeringController,
    SteeringCommand,
    SteeringSnapshot,
)
from modular_framework_control.mobile_base.mobile_base_controller import (
    BaseFrames,
    BaseVelocity,
    MobileBaseController,
    OdometrySnapshot,
)
from modular_framework_control.ros.controller_connection import ControllerConnection
from modular_framework_ros.reconfiguration import Adjustable, Reconfiguration

QUEUE_SIZE = 100
DIFF_DRIVE_SETTINGS = (
    Adjustable("left_wheel_radius_multiplier", 0.5, 1.5, "factor of the radius of the left wheels"),
    Adjustable("right_wheel_radius_multiplier", 0.5, 1.5, "factor of the radius of the right wheels"),
    Adjustable("wheel_separation_multiplier", 0.5, 1.5, "factor of the wheel separation"),
    Adjustable("publish_rate", 0.0, 2000.0, "rate of the odometry [Hz]; 0: none"),
    Adjustable("enable_odom_tf", False, True, "publish the frame of the base on tf"),
)


class MobileBaseRosInterface:
    """Opens the topics common to all mobile bases.

    Subscribes to `<name>/cmd_vel` (geometry_msgs/Twist); publishes `<name>/odom` (nav_msgs/Odometry) and, if enabled,
    the frame of the base on `/tf`.
    """

    def __init__(self, controller: MobileBaseController, connection: ControllerConnection) -> None:
        self._controller, self._connection = controller, connection
        publish_odometry = connection.advertise("odom", Odometry, QUEUE_SIZE)
        publish_frame = connection.advertise("/tf", TFMessage, QUEUE_SIZE)
        self._subscribe("cmd_vel", Twist, lambda twist: BaseVelocity(twist.linear.x, twist.angular.z))

        def report(snapshot: OdometrySnapshot) -> None:
            frames, ahead_s = controller.frames, connection.ahead_s
            publish_odometry(lambda: odometry_to_msg(snapshot, frames, ahead_s))
            if snapshot.with_tf:
                publish_frame(lambda: transform_to_msg(snapshot, frames, ahead_s))

        controller.on_odometry = report

    def _subscribe(self, topic: str, message_class: Any, command_of: Any) -> None:
        """Passes each message of a topic, converted by `command_of`, to the controller."""
        name = self._connection.topic(topic)
        subscribers: list[rospy.Subscriber] = []  # a message may arrive before the subscriber is stored

        def on_message(message: Any) -> None:
            publishers = sum(subscriber.get_num_connections() for subscriber in subscribers)
            if publishers > 1 and not self._controller.allows_several_publishers:
                self._controller.drop_command()
                rospy.logerr_throttle(
                    1.0,
                    f"{name}: got {publishers} publishers; expected one, as "
                    f"{self._connection.name}/allow_multiple_cmd_vel_publishers is false; the base stops: "
                    "end the other publishers",
                )
                return
            try:
                self._controller.submit(command_of(message))
            except ControllerError as error:
                rospy.logwarn_throttle(1.0, f"{name} ignored: {error}")

        subscribers.append(self._connection.subscribe(topic, message_class, on_message))


class DiffDriveRosInterface(MobileBaseRosInterface):
    """Opens the common topics, the topics of a differential drive and its dynamic_reconfigure server in `<name>`.

    Publishes, if enabled, `<name>/cmd_vel_out` (geometry_msgs/TwistStamped) and `<name>/wheel_joint_controller_state`
    (control_msgs/JointTrajectoryControllerState).
    """

    def __init__(self, controller: DiffDriveController, connection: ControllerConnection) -> None:
        super().__init__(controller, connection)
        names = controller.wheel_names
        if controller.publishes_command:
            publish_command = connection.advertise("cmd_vel_out", TwistStamped, QUEUE_SIZE)
            controller.on_command = lambda time_s, velocity: publish_command(
                lambda: velocity_to_msg(time_s + connection.ahead_s, velocity)
            )
        if controller.publishes_wheels:
            publish_wheels = connection.advertise(
                "wheel_joint_controller_state", JointTrajectoryControllerState, QUEUE_SIZE
            )
            controller.on_wheels = lambda time_s, states: publish_wheels(
                lambda: wheels_to_msg(time_s + connection.ahead_s, names, states)
            )
        settings = Reconfiguration(connection.name, DIFF_DRIVE_SETTINGS, controller, "settings")
        connection.opened.callback(settings.close)
        settings.connect()


class FourWheelSteeringRosInterface(MobileBaseRosInterface):
    """Opens the common topics and the topics of a base with four steered wheels.

    Subscribes to `<name>/cmd_four_wheel_steering` (four_wheel_steering_msgs/FourWheelSteering); publishes
    `<name>/odom_steer` (four_wheel_steering_msgs/FourWheelSteeringStamped).
    """

    def __init__(self, controller: FourWheelSteeringController, connection: ControllerConnection) -> None:
        # Imported here, as no other controller needs this message package.
        from four_wheel_steering_msgs.msg import FourWheelSteering, FourWheelSteeringStamped

        super().__init__(controller, connection)
        self._subscribe(
            "cmd_four_wheel_steering",
            FourWheelSteering,
            lambda command: SteeringCommand(command.speed, command.front_steering_angle, command.rear_steering_angle),
        )
        publish_steering = connection.advertise("odom_steer", FourWheelSteeringStamped, QUEUE_SIZE)
        frame = controller.frames.odom
        controller.on_steering = lambda snapshot: publish_steering(
            lambda: fill_steering(FourWheelSteeringStamped(), snapshot, frame, connection.ahead_s)
        )


def odometry_to_msg(snapshot: OdometrySnapshot, frames: BaseFrames, ahead_s: float) -> Odometry:
    """Returns the pose and the velocity of the base as a message.

    Args:
        snapshot: Odometry of the base.
        frames: Frame names and covariances.
        ahead_s: Offset of the stamp from the time of the loop [s].
    """
    message = Odometry()
    message.header.stamp = rospy.Time.from_sec(snapshot.time_s + ahead_s)
    message.header.frame_id, message.child_frame_id = frames.odom, frames.base
    message.pose.pose.position.x, message.pose.pose.position.y = snapshot.x, snapshot.y
    message.pose.pose.orientation = _rotation_about_z(snapshot.heading)
    message.twist.twist.linear.x, message.twist.twist.linear.y = snapshot.linear, snapshot.lateral
    message.twist.twist.angular.z = snapshot.angular
    for covariance, diagonal in (
        (message.pose.covariance, frames.pose_covariance),
        (message.twist.covariance, frames.twist_covariance),
    ):
        covariance[::7] = diagonal
    return message


def transform_to_msg(snapshot: OdometrySnapshot, frames: BaseFrames, ahead_s: float) -> TFMessage:
    """Returns the transform from the odometry frame to the base frame.

    Args:
        snapshot: Odometry of the base.
        frames: Frame names.
        ahead_s: Offset of the stamp from the time of the loop [s].
    """
    transform = TransformStamped(child_frame_id=frames.base)
    transform.header.stamp = rospy.Time.from_sec(snapshot.time_s + ahead_s)
    transform.header.frame_id = frames.odom
    transform.transform.translation.x, transform.transform.translation.y = snapshot.x, snapshot.y
    transform.transform.rotation = _rotation_about_z(snapshot.heading)
    return TFMessage([transform])


def velocity_to_msg(stamp_s: float, velocity: BaseVelocity) -> TwistStamped:
    """Returns the velocity command as a message stamped with ROS time `stamp_s` [s]."""
    message = TwistStamped()
    message.header.stamp = rospy.Time.from_sec(stamp_s)
    message.twist.linear.x, message.twist.angular.z = velocity.linear, velocity.angular
    return message


def fill_steering(message: Any, snapshot: SteeringSnapshot, frame_id: str, ahead_s: float) -> Any:
    """Writes the speed of the base and the angles of its axles into a message, and returns the message.

    Args:
        message: Message of type FourWheelSteeringStamped.
        snapshot: Speed and axle angles.
        frame_id: Name of the odometry frame.
        ahead_s: Offset of the stamp from the time of the loop [s].
    """
    message.header.stamp = rospy.Time.from_sec(snapshot.time_s + ahead_s)
    message.header.frame_id = frame_id
    data = message.data
    data.speed, data.acceleration, data.jerk = snapshot.values
    data.front_steering_angle, data.rear_steering_angle = snapshot.angles
    data.front_steering_angle_velocity, data.rear_steering_angle_velocity = snapshot.angle_velocities
    return message


def wheels_to_msg(stamp_s: float, names: list[str], states: list[WheelState]) -> JointTrajectoryControllerState:
    """Returns the states and commands of the wheels as a message; commanded efforts are NaN.

    Args:
        stamp_s: Stamp of the message in ROS time [s].
        names: Joint names of the wheels.
        states: States and commands, one per wheel.
    """
    message = JointTrajectoryControllerState(joint_names=names)
    message.header.stamp = rospy.Time.from_sec(stamp_s)
    unknown = [math.nan] * len(states)
    message.actual.positions = [state.position for state in states]
    message.actual.velocities = [state.velocity for state in states]
    message.actual.accelerations = [state.acceleration for state in states]
    message.actual.effort = [state.effort for state in states]
    message.desired.positions = [state.desired_position for state in states]
    message.desired.velocities = [state.desired_velocity for state in states]
    message.desired.accelerations = [state.desired_acceleration for state in states]
    message.error.positions = [state.desired_position - state.position for state in states]
    message.error.velocities = [state.desired_velocity - state.velocity for state in states]
    message.error.accelerations = [state.desired_acceleration - state.acceleration for state in states]
    message.desired.effort = message.error.effort = unknown
    return message


def _rotation_about_z(angle: float) -> Quaternion:
    return Quaternion(0.0, 0.0, math.sin(angle / 2.0), math.cos(angle / 2.0))
