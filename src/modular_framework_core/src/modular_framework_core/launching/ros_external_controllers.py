# SPDX-License-Identifier: BSD-3-Clause
"""Runs the node that drives the manipulator, and exits with an error if that node dies."""

from __future__ import annotations

import contextlib
import signal
import subprocess

import roslib.packages
import rospkg
import rospy

from modular_framework_core.launching.external_controllers import (
    NAME_KEY,
    PACKAGE_KEY,
    TYPE_KEY,
    ControllerNode,
    controller_node,
)
from modular_framework_ros.node_handle import ParameterError

POLL_PERIOD_S = 0.2
STOP_TIMEOUT_S = 5.0
END_WITH_SPAWNER = ("setpriv", "--pdeathsig", "TERM")
"""Command prefix that sends SIGTERM to the node if the spawner is killed."""


def main() -> int:
    """Runs the node ``external_controllers_spawner``.

    Parameters: ``package_manipulator_action_server``, ``manipulator_controller_node_name``,
    ``manipulator_controller_action_server_type``.

    Returns:
        Exit code: 0 at shutdown of ROS, 1 if the node died, 2 for incomplete parameters.
    """
    rospy.init_node("external_controllers_spawner", anonymous=True, disable_rostime=True)  # does not need /clock
    try:
        keys = (PACKAGE_KEY, TYPE_KEY, NAME_KEY)
        node = controller_node({key: rospy.get_param(key) for key in keys if rospy.has_param(key)})
    except ParameterError as error:
        rospy.logfatal("external_controllers_spawner: %s", error)
        return 2
    if node is None:
        rospy.loginfo("No external controller to start: '%s' is empty.", PACKAGE_KEY)
        rospy.spin()  # launch files may require this node, so it keeps running
        return 0
    return run_node(node)


def run_node(node: ControllerNode) -> int:
    """Runs a node and returns the exit code: 0 at shutdown of ROS, 1 if the node cannot start or dies."""
    label = f"Node '{node.name}' ({node.package}/{node.node_type})"
    try:
        executables = roslib.packages.find_node(node.package, node.node_type)
        if not executables:
            raise OSError(f"package '{node.package}' has no executable '{node.node_type}'")
        process = subprocess.Popen([*END_WITH_SPAWNER, executables[0], f"__name:={node.name}"])
    except (OSError, rospkg.ResourceNotFound) as error:
        rospy.logfatal("%s cannot be started: %s; correct %s and %s", label, error, PACKAGE_KEY, TYPE_KEY)
        return 1
    try:
        while not rospy.is_shutdown():
            if process.poll() is not None:
                rospy.logfatal(
                    "%s ended with exit code %s; the manipulator can no longer be driven.", label, process.returncode
                )
                return 1
            rospy.rostime.wallsleep(POLL_PERIOD_S)
    finally:
        _stop(process)
    return 0


def _stop(process: subprocess.Popen[bytes]) -> None:
    for stop_signal in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            return
        process.send_signal(stop_signal)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(STOP_TIMEOUT_S)
