# SPDX-License-Identifier: BSD-3-Clause
"""Node joint_state_publisher: publishes joint states, and opens the window if `~use_gui` is true."""

from __future__ import annotations

import rospy

from joint_sliders.ros_publisher import declared_parameters, joint_state_publisher


def main() -> int:
    """Runs the node and returns the exit code; the parameter `~use_gui` opens the window."""
    rospy.init_node("joint_state_publisher")
    if declared_parameters().value("~use_gui"):
        from joint_sliders import ros_window  # without the window, the node does not need Qt

        return ros_window.run()
    publisher = joint_state_publisher()
    if publisher is None:
        return 1
    publisher.start(on_change=lambda: None)
    rospy.spin()
    return 0
