# SPDX-License-Identifier: BSD-3-Clause
"""ROS node of an external method: reads parameters, collects inputs and returns the grasps as candidates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from external_grasps.grasp_conversions import grasp_candidates, grasp_request
from external_grasps.ros_camera_source import CameraSource
from mbf_method.errors import MethodError, MethodFault
from mbf_method.grasp_request import RobotState
from mbf_method.grasps import checked_grasps
from mbf_method.method_client import CallTimes, MethodClient, MethodLimits, MethodSource
from mbf_method.served_method import GRASPS
from modular_framework_core.grasp_generation.grasp_candidates import (
    GraspCandidate,
    GraspQuery,
    MethodFaultError,
    ReadNumber,
)
from modular_framework_core.grasp_generation.ros_generator_settings import ParameterisedMethod, read_hand_motion
from modular_framework_core.grasp_generation.ros_grasp_generator import run_grasp_generator
from modular_framework_ros.reported_figures import (
    METHOD_FAULT,
    METHOD_TIME,
    QUEUE_TIME,
    SOURCES_PARAMETER,
    TRANSPORT_TIME,
    Figure,
)


@dataclass(frozen=True, slots=True)
class ExternalSettings:
    """Parameters that determine the method and its limits.

    Attributes:
        source: Location of the method (``~command``, ``~address``), and of copies of its inputs (``~record_inputs``).
        limits: Time and size limits (``~start_limit``, ``~time_limit``, ``~size_limit``).
    """

    source: MethodSource
    limits: MethodLimits


class ExternalMethod(ParameterisedMethod):
    """Grasp method that calls a function in another process, which this class starts or connects to.

    A fault of the method ends the generation. The next generation starts the method again.

    Parameters: those of :func:`read_external_settings`, ``~max_candidates``, ``~camera_timeout`` and the distances of
        the hand motion, read again for every object; ``origin_frame_name``.
    Parameters set by the node, for records: ``~method_sources``, see :attr:`sources`.
    Subscribers: ``joint_states`` (sensor_msgs/JointState); see :class:`CameraSource`.
    """

    manner = "by the external method"
    declared_in = ("external_grasps", "external_grasp_generator")

    def __init__(self, read: ReadNumber | None = None) -> None:
        """Creates the method without starting its process."""
        super().__init__(read)
        self._settings: ExternalSettings | None = None
        self._client: MethodClient | None = None
        self._robot = RobotState((), np.zeros(0))
        self._times: list[CallTimes] = []
        self._fault: MethodFault | None = None
        self._camera = CameraSource()
        self._recorded_sources = ""

    def connect(self) -> None:
        """Subscribes to the joint states and starts the method; a fault is logged."""
        rospy.Subscriber("joint_states", JointState, self._on_joint_state, queue_size=1)
        self.start()

    def start(self) -> None:
        """Starts the method, no effect while it runs; a fault is logged."""
        try:
            self._started_client()
        except MethodError as error:
            rospy.logerr("%s: %s", rospy.get_name(), error)

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps in the order of their scores.

        Raises:
            MethodFaultError: The method did not return a valid result; the message gives the cause.
            NoCandidatesError: The method needs camera images, but no images arrive.
        """
        settings, max_grasps = read_hand_motion(self.read), int(self.read("~max_candidates"))
        frame = str(rospy.get_param("origin_frame_name", "world")) if rospy.core.is_initialized() else "world"
        try:
            client = self._started_client()
            camera = self._camera.take(frame, self.read("~camera_timeout")) if client.needs_camera else None
            request = grasp_request(query, frame, self._robot, camera)
            result = client.call(request)
            self._times.append(result.times)
            grasps = checked_grasps(result.message, request, max_grasps)
        except MethodError as error:
            self._fault = error.fault
            raise MethodFaultError(str(error)) from error
        return grasp_candidates(grasps, query.gripper, settings)

    def reached_quality(self, candidate: GraspCandidate, joint_travel: float) -> float:
        """Returns the score of the grasp, independent of the joint travel."""
        return candidate.quality

    def take_figures(self) -> dict[Figure, float]:
        """Returns the summed call durations and the fault of the external method since the previous `take_figures`."""
        times, fault = self._times, self._fault
        self._times, self._fault = [], None
        figures: dict[Figure, float] = {} if fault is None else {METHOD_FAULT: float(fault)}
        if times:
            figures[METHOD_TIME] = sum(call.method_s for call in times)
            figures[QUEUE_TIME] = sum(call.queue_s for call in times)
            figures[TRANSPORT_TIME] = sum(call.transport_s for call in times)
        return figures

    def close(self) -> None:
        """Ends the method's process."""
        if self._client is not None:
            self._client.close()

    @property
    def sources(self) -> str:
        """Digest of the sources in the method's process; "" before its start, or if the method does not report them."""
        return "" if self._client is None else self._client.sources

    def _started_client(self) -> MethodClient:
        """Returns the started client for the current parameters; subscribes to TF if the method needs a camera."""
        settings = read_external_settings(self.read)
        if self._client is None or settings != self._settings:
            self.close()
            self._client, self._settings = MethodClient(settings.source, GRASPS, settings.limits), settings
        self._client.start()
        if rospy.core.is_initialized() and self._client.sources != self._recorded_sources:
            self._recorded_sources = self._client.sources
            rospy.set_param(f"~{SOURCES_PARAMETER}", self._recorded_sources)
        if self._client.needs_camera:
            self._camera.connect()
        return self._client

    def _on_joint_state(self, message: JointState) -> None:
        self._robot = RobotState(tuple(message.name), np.array(message.position))


def read_external_settings(read: ReadNumber) -> ExternalSettings:
    """Reads the parameters that determine the method.

    Args:
        read: Function that reads a parameter.
    """
    command, address, folder = read("~command"), read("~address"), read("~record_inputs")
    return ExternalSettings(
        MethodSource(tuple(command), str(address), str(folder)),
        MethodLimits(read("~start_limit"), read("~time_limit"), int(read("~size_limit"))),
    )


def main() -> int:
    """Runs the node ``external_grasp_generator``; returns 1 if a requirement is missing."""
    method = ExternalMethod()
    try:
        return run_grasp_generator("external_grasp_generator", method)
    finally:
        method.close()
