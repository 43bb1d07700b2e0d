# SPDX-License-Identifier: BSD-3-Clause
"""Starts the node that drives the manipulator, and ends with an error when that node dies."""

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
"""Prefix of the node's command: the node gets SIGTERM also when the spawner is killed and cannot stop it."""


def main() -> int:
    """Runs the node ``external_controllers_spawner``.

    Parameters: ``package_manipulator_action_server``, ``manipulator_controller_node_name``,
    ``manipulator_controller_action_server_type``.

    Returns:
        0 when ROS shuts down, 1 when the node died, 2 when the parameters are incomplete.
    """
    rospy.init_node("external_controllers_spawner", anonymous=True, disable_rostime=True)  # it needs no /clock
    try:
        keys = (PACKAGE_KEY, TYPE_KEY, NAME_KEY)
        node = controller_node({key: rospy.get_param(key) for key in keys if rospy.has_param(key)})
    except ParameterError as error:
        rospy.logfatal("external_controllers_spawner: %s", error)
        return 2
    if node is None:
        rospy.loginfo("No external controller to start: '%s' is empty.", PACKAGE_KEY)
        rospy.spin()  # a launch that requires this node goes on without one
        return 0
    return run_until_it_ends(node)


def run_until_it_ends(node: ControllerNode) -> int:
    """Runs a node; 0 when ROS shuts down first, 1 when the node cannot start or dies."""
    what = f"Node '{node.name}' ({node.package}/{node.node_type})"
    try:
        found = roslib.packages.find_node(node.package, node.node_type)
        if not found:
            raise OSError(f"package '{node.package}' has no executable '{node.node_type}'")
        process = subprocess.Popen([*END_WITH_SPAWNER, found[0], f"__name:={node.name}"])
    except (OSError, rospkg.ResourceNotFound) as error:
        rospy.logfatal("%s cannot be started: %s; correct %s and %s", what, error, PACKAGE_KEY, TYPE_KEY)
        return 1
    try:
        while not rospy.is_shutdown():
            if process.poll() is not None:
                rospy.logfatal(
                    "%s ended with exit code %s; the manipulator cannot be driven any more.", what, process.returncode
                )
                return 1
            rospy.rostime.wallsleep(POLL_PERIOD_S)
    finally:
        _stop(process)
    return 0


def _stop(process: subprocess.Popen[bytes]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            return
        process.send_signal(number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(STOP_TIMEOUT_S)
