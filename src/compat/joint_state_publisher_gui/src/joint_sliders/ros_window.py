# SPDX-License-Identifier: BSD-3-Clause
"""Node joint_state_publisher_gui: runs the window's event loop in the main thread."""

from __future__ import annotations

import signal
import sys

import rospy
from python_qt_binding.QtCore import QTimer
from python_qt_binding.QtWidgets import QApplication

from joint_sliders.ros_publisher import joint_state_publisher
from joint_sliders.window import SliderWindow

SIGNAL_PERIOD_MS = 200
"""Period at which Qt's event loop runs Python's signal handlers."""


def main() -> int:
    """Starts the node, shows the window until it is closed, and returns the exit code."""
    rospy.init_node("joint_state_publisher_gui", disable_signals=True)
    return run()


def run() -> int:
    """Shows the window until it is closed or the node shuts down; returns the exit code. Call init_node before."""
    publisher = joint_state_publisher()
    if publisher is None:
        return 1
    application = QApplication(sys.argv[:1])
    title = f"Node: {rospy.get_name()}"
    window = SliderWindow(title, publisher.joints, publisher.values, publisher.parameters.num_rows)
    publisher.start(on_change=window.values_changed.emit)
    window.show()
    _end_with_node(application)
    code = int(application.exec_())
    rospy.signal_shutdown("the window was closed")
    return code


def _end_with_node(application: QApplication) -> None:
    """Quits Qt's event loop on SIGINT, on SIGTERM and on shutdown of the node."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: application.quit())
    timer = QTimer(application)
    timer.timeout.connect(lambda: application.quit() if rospy.is_shutdown() else None)
    timer.start(SIGNAL_PERIOD_MS)
