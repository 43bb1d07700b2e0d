# SPDX-License-Identifier: BSD-3-Clause
"""Shows the running state of a task as a text above the robot, for RViz."""

from __future__ import annotations

import rospy
from visualization_msgs.msg import Marker

from modular_framework_core.task_runner.task_runner import TaskResult
from modular_framework_urdf.planning_groups import KinematicTree
from modular_framework_urdf.robot import Joint
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

HEIGHT_M = 0.8
"""Height of the text above the base of the arm, beyond most postures [m]."""
LETTER_M = 0.07
"""Height of a capital letter [m]."""
LINE_LENGTH = 60
"""Maximum number of characters of a reason."""
RUNNING, SUCCEEDED, FAILED = (1.0, 1.0, 1.0), (0.4, 1.0, 0.4), (1.0, 0.4, 0.4)
"""Colours of the text, red, green and blue from 0 to 1."""


class StateText:
    """Publishes `task_marker` (visualization_msgs/Marker, latched), if the robot's description is known.

    The marker is in the frame of the link that carries the first movable joint.
    """

    def __init__(self, task: str) -> None:
        """Advertises the topic.

        Args:
            task: Name of the task.
        """
        self._task = task
        self._base = _first_joint(str(rospy.get_param("/robot_description", "")))
        self._publisher = rospy.Publisher("task_marker", Marker, queue_size=10, latch=True)

    def show_state(self, path: str) -> None:
        """Shows a state that starts.

        Args:
            path: Labels from the root to the state, joined by "/".
        """
        self._show(path, RUNNING)

    def show_result(self, result: TaskResult) -> None:
        """Shows the result of the task, with the last reason of a failure."""
        if result.succeeded:
            self._show(f"SUCCEEDED: {result.outcome}", SUCCEEDED)
            return
        reason = result.error or (
            f"{result.failures[-1].path}: {result.failures[-1].last_reason}" if result.failures else ""
        )
        shortened = reason if len(reason) <= LINE_LENGTH else f"{reason[: LINE_LENGTH - 3]}..."
        self._show(f"FAILED: {result.outcome}\n{shortened}", FAILED)

    def _show(self, text: str, color: tuple[float, float, float]) -> None:
        if self._base is None:
            return
        marker = Marker(type=Marker.TEXT_VIEW_FACING, action=Marker.ADD, ns="task", text=f"{self._task}\n{text}")
        marker.header.frame_id, marker.frame_locked = self._base.parent, True
        marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = self._base.origin.xyz
        marker.pose.position.z += HEIGHT_M
        marker.pose.orientation.w = 1.0
        marker.scale.z = LETTER_M
        marker.color.r, marker.color.g, marker.color.b = color
        marker.color.a = 1.0
        self._publisher.publish(marker)


def _first_joint(description: str) -> Joint | None:
    """Returns the movable joint of a URDF that no other joint moves, the first of several, or None."""
    try:
        joints = read_urdf(description).joints if description else ()
    except XmlError:  # move_group reports the fault
        return None
    tree = KinematicTree({joint.name: (joint.parent, joint.child) for joint in joints})
    movable = {joint.name: joint for joint in joints if joint.is_movable}
    return next(
        (joint for joint in movable.values() if not any(above in movable for above, _ in tree.up(joint.parent))), None
    )
