# SPDX-License-Identifier: BSD-3-Clause
"""Node joint_state_publisher: publishes joint states, with the window where that is asked for."""

from __future__ import annotations

import rospy

from joint_sliders.ros_publisher import declared_parameters, joint_state_publisher


def main() -> int:
    """Publishes without a window, or with one where the parameter use_gui is true; returns the exit code."""
    rospy.init_node("joint_state_publisher")
    if declared_parameters().value("~use_gui"):
        from joint_sliders import ros_window  # a computer without a screen needs no library of windows

        return ros_window.run()
    publisher = joint_state_publisher()
    if publisher is None:
        return 1
    publisher.start(on_change=lambda: None)
    rospy.spin()
    return 0
