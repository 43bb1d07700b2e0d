# SPDX-License-Identifier: BSD-3-Clause
"""Starts the node that drives the manipulator, and ends with an error when that node dies."""
from __future__ import annotations

import roslaunch
import rospy

from modular_framework_core.external_controllers import (
    NAME_KEY,
    PACKAGE_KEY,
    TYPE_KEY,
    ControllerNode,
    ExternalControllerError,
    controller_node,
)

POLL_PERIOD_S = 0.2
END_WITH_SPAWNER = "setpriv --pdeathsig TERM"
"""Put before the node's command: the node is told to end when the spawner is killed, which could not stop it itself."""


def main() -> int:
    """Runs the node ``external_controllers_spawner``.

    Parameters: ``package_manipulator_action_server``, ``manipulator_controller_node_name``,
    ``manipulator_controller_action_server_type``.

    Returns:
        0 when there is nothing to run or ROS shuts down, 1 when the node died, 2 when the parameters are incomplete.
    """
    rospy.init_node("external_controllers_spawner", anonymous=True)
    try:
        keys = (PACKAGE_KEY, TYPE_KEY, NAME_KEY)
        node = controller_node({key: rospy.get_param(key) for key in keys if rospy.has_param(key)})
    except ExternalControllerError as error:
        rospy.logfatal("external_controllers_spawner: %s", error)
        return 2
    if node is None:
        rospy.loginfo("No external controller to start: '%s' is empty.", PACKAGE_KEY)
        return 0
    return run_until_it_ends(node)


def run_until_it_ends(node: ControllerNode) -> int:
    """Runs a node; 0 when ROS shuts down first, 1 when the node cannot start or dies."""
    launch = roslaunch.scriptapi.ROSLaunch()
    launch.start()
    try:
        process = launch.launch(roslaunch.core.Node(node.package, node.node_type, name=node.name, output="screen",
                                                    launch_prefix=END_WITH_SPAWNER))
        while not rospy.is_shutdown():
            if not process.is_alive():
                rospy.logfatal("Node '%s' (%s/%s) ended with exit code %s; the manipulator cannot be driven any more.",
                               node.name, node.package, node.node_type, process.exit_code)
                return 1
            rospy.rostime.wallsleep(POLL_PERIOD_S)
    except roslaunch.RLException as error:
        rospy.logfatal("Node '%s' (%s/%s) cannot be started: %s", node.name, node.package, node.node_type, error)
        return 1
    finally:
        launch.stop()
    return 0
