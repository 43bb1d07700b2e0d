# SPDX-License-Identifier: BSD-3-Clause
"""Asks move_group for poses of links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.srv import GetPositionFK, GetPositionFKRequest

from modular_framework_core.commander.moveit_requests import error_name, robot_state
from modular_framework_ros.calls import CallError, request_service


def link_poses(commander: Any, links: Sequence[str], timeout_s: float) -> list[PoseStamped]:
    """Returns the poses of links in the current state, in the planning frame.

    Args:
        commander: Arm commander.
        links: Names of the links.
        timeout_s: Timeout of the service `compute_fk` [s].

    Raises:
        CallError: move_group does not answer or does not know a link.
    """
    request = GetPositionFKRequest(fk_link_names=links, robot_state=robot_state(commander.current_joints()))
    response = request_service("compute_fk", GetPositionFK, request, timeout_s)
    if len(response.pose_stamped) != len(links):
        names = ", ".join(f"'{link}'" for link in links)
        raise CallError(
            f"'{rospy.resolve_name('compute_fk')}' did not return the pose of link {names}: "
            f"{error_name(response.error_code.val)}"
        )
    return list(response.pose_stamped)
