# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the joint states of a robot; independent of the window."""

from __future__ import annotations

import threading
from collections.abc import Callable

import rospy
from sensor_msgs.msg import JointState

from joint_sliders.joint_values import JointValues
from joint_sliders.node_parameters import NodeParameters, read_parameters
from joint_sliders.slider_joints import SliderJoints, slider_joints
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader, existing_declaration
from modular_framework_ros.publishing import publish
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

OUTPUT = "joint_states"


class JointStatePublisher:
    """Publishes joint states at a fixed rate, and adopts joint states from source topics.

    Parameters, private or in the node's namespace: see `parameters/joint_state_publisher_gui.yaml`.
    Subscribers: the topics of source_list (sensor_msgs/JointState).
    Publishers: joint_states (sensor_msgs/JointState).

    Args:
        joints: Joints of the robot.
        parameters: Parameters of the node.

    Attributes:
        joints: Joints of the robot.
        parameters: Parameters of the node.
        values: Published joint values.
    """

    def __init__(self, joints: SliderJoints, parameters: NodeParameters) -> None:
        self.joints, self.parameters = joints, parameters
        defaults = (parameters.default_positions, parameters.default_velocities, parameters.default_efforts)
        self.values = JointValues(joints, *defaults)

    def start(self, on_change: Callable[[], None]) -> None:
        """Starts the publishing thread and the subscribers.

        Args:
            on_change: Function called after each change of the values, from any thread.
        """
        self._publisher = rospy.Publisher(OUTPUT, JointState, queue_size=5)
        self._on_change = on_change
        for topic in self.parameters.source_list:
            rospy.Subscriber(topic, JointState, self._receive)
        threading.Thread(target=self._publish_all, daemon=True).start()

    def _receive(self, message: JointState) -> None:
        if message._connection_header["callerid"] == rospy.get_name():
            return  # source_list may contain the topic that this node publishes
        self.values.receive(message.name, message.position, message.velocity, message.effort)
        self._on_change()

    def _publish_all(self) -> None:
        rate = rospy.Rate(self.parameters.rate, reset=True)
        while not rospy.is_shutdown():
            if self.parameters.delta > 0:
                self.values.sweep(self.parameters.delta)
                self._on_change()
            self._publish()
            try:
                rate.sleep()
            except rospy.ROSInterruptException:
                return

    def _publish(self) -> None:
        arrays = self.values.arrays()
        message = JointState(
            name=list(arrays.names),
            position=list(arrays.positions),
            velocity=list(arrays.velocities),
            effort=list(arrays.efforts),
        )
        message.header.stamp = rospy.Time.now()
        if arrays.names:
            publish(self._publisher, message)


def joint_state_publisher() -> JointStatePublisher | None:
    """Returns the publisher configured by the parameters; logs invalid parameters and returns None."""
    declared = declared_parameters()
    try:
        parameters = read_parameters(declared)
        joints = slider_joints(read_urdf(declared.value("~robot_description")), parameters.settings)
    except (ParameterError, XmlError, ValueError) as error:
        for line in str(error).splitlines():
            rospy.logfatal("%s", line)
        return None
    for warning in joints.warnings:
        rospy.logwarn("%s", warning)
    return JointStatePublisher(joints, parameters)


def declared_parameters() -> ParameterReader:
    """Returns a reader of the node's parameters: private names first, then the node's namespace, then the defaults."""
    return ParameterReader(
        existing_declaration("joint_state_publisher_gui", "joint_state_publisher_gui"),
        lambda name: rospy.get_param(name, rospy.get_param(name[1:], None)),
        lambda name: rospy.resolve_name(name if rospy.has_param(name) else name[1:]),
    )
