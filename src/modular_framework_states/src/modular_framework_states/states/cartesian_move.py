# SPDX-License-Identifier: BSD-3-Clause
"""A state that moves the tip of the arm along a straight line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Unpack

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.srv import GetCartesianPath, GetCartesianPathRequest
from scipy.spatial.transform import Rotation

from modular_framework_core.commander.moveit_requests import error_name, robot_state
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits, Share, Vector
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError, request_service
from modular_framework_states.link_poses import link_poses
from modular_framework_states.manager_clients import ManagerError, fetch

TIMEOUT_S = 20.0


class CartesianMove(FrameworkState):
    """Moves the tip link on a straight line to a named pose or by an offset; positive if the whole line was executed.

    Args:
        pose_name: Name of a pose in the pose manager; empty with an offset.
        offset: Translation (x, y, z) [m] at constant orientation, instead of a pose.
        offset_in_tip: Whether the offset is given in the frame of the tip link instead of the planning frame.
        max_step: Maximum step along the line [m].
        min_fraction: Minimum fraction of the line that must be free; with less, the arm does not move.
        speed: Maximum speed of the tip [m/s]; 0 for no limit.
        avoid_collisions: False allows motion in contact.
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("arm_commander",)

    def __init__(
        self,
        pose_name: Annotated[str, Named("pose")] = "",
        offset: Vector | None = None,
        offset_in_tip: bool = False,
        max_step: Annotated[float, Limits(above=0.0, at_most=1000.0)] = 0.01,
        min_fraction: Share = 1.0,
        speed: Annotated[float, Limits(at_least=0.0, at_most=1000.0)] = 0.0,
        avoid_collisions: bool = True,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        if bool(pose_name) == (offset is not None):
            raise ValueError("CartesianMove: give either pose_name or offset")
        self._pose_name, self._offset, self._in_tip = pose_name, offset, offset_in_tip
        self._request = GetCartesianPathRequest(
            max_step=float(max_step), avoid_collisions=bool(avoid_collisions), max_cartesian_speed=float(speed)
        )
        self._min_fraction = float(min_fraction)

    def execute(self, userdata: Any) -> str:
        """Requests the path, and executes the path if its fraction suffices."""
        commander = userdata.arm_commander
        try:
            target = self._target(commander)
            response = self._path(commander, target)
        except (ManagerError, CallError) as error:
            return self.fail(f"straight line: {error}")
        if self.preempt_requested():
            return self.stopped()
        if response.fraction < self._min_fraction - 1e-9 or not response.solution.joint_trajectory.points:
            return self.fail(
                f"straight line: only {response.fraction:.1%} of the line can be moved "
                f"({error_name(response.error_code.val)}), but {self._min_fraction:.1%} are required; the log of "
                "move_group gives the end of the line and the reason"
            )
        result = commander.execute_plan(response.solution, stop_requested=self.preempt_requested)
        if self.preempt_requested():
            return self.stopped()
        return self.succeed() if result else self.fail(f"straight line: not executed: {result.reason}")

    def _target(self, commander: Any) -> PoseStamped:
        if self._offset is None:
            return fetch("pose", self._pose_name)
        (tip,) = link_poses(commander, [commander.group.tip_link], TIMEOUT_S)
        return translate_pose(tip, self._offset, self._in_tip)

    def _path(self, commander: Any, target: PoseStamped) -> Any:
        request = self._request
        request.header.frame_id, request.waypoints = target.header.frame_id, [target.pose]
        request.group_name, request.link_name = commander.group_name, commander.group.tip_link
        request.cartesian_speed_limited_link = request.link_name if request.max_cartesian_speed else ""
        request.start_state = robot_state(commander.current_joints())
        return request_service("compute_cartesian_path", GetCartesianPath, request, TIMEOUT_S)


def translate_pose(pose: PoseStamped, offset: Sequence[float], in_own_frame: bool) -> PoseStamped:
    """Returns a pose translated by an offset.

    Args:
        pose: Pose to translate.
        offset: Translation (x, y, z) [m].
        in_own_frame: Whether the offset is given in the pose's own frame instead of its header's frame.
    """
    orientation = pose.pose.orientation
    step = np.asarray(offset, dtype=float)
    if in_own_frame:
        step = Rotation.from_quat([orientation.x, orientation.y, orientation.z, orientation.w]).apply(step)
    result = PoseStamped(header=pose.header, pose=Pose(orientation=orientation))
    for axis, value in zip("xyz", step, strict=True):
        setattr(result.pose.position, axis, getattr(pose.pose.position, axis) + float(value))
    return result
