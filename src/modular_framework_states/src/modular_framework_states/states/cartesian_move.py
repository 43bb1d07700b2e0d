# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task move the tip of the arm along a straight line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Unpack

import numpy as np
import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.srv import GetCartesianPath, GetCartesianPathRequest, GetPositionFK, GetPositionFKRequest
from scipy.spatial.transform import Rotation

from modular_framework_core.commander.moveit_requests import error_name, robot_state
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits, Share, Vector
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError, request_service
from modular_framework_states.manager_clients import ManagerError, fetch

TIMEOUT_S = 20.0


class CartesianMove(FrameworkState):
    """Moves the tip link in a straight line to a named pose, or by an offset; positive when the whole line was moved.

    Args:
        pose_name: Name of a pose in the pose manager; empty with an offset.
        offset: X, y, z to move by [m], instead of a pose; the orientation stays.
        offset_in_tip: True gives the offset in the frame of the tip link, False in the planning frame.
        max_step: Longest step along the line [m].
        min_fraction: Share of the line that must be free; anything less is not moved at all.
        speed: Bound on the speed of the tip [m/s]; 0 for none.
        avoid_collisions: False moves through contacts on purpose.
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
        """Requests the path, and moves if enough of it was found."""
        commander = userdata.arm_commander
        try:
            target = self._target(commander)
            answer = self._path(commander, target)
        except (ManagerError, CallError) as error:
            return self.fail(f"straight line: {error}")
        if self.preempt_requested():
            return self.stopped()
        if answer.fraction < self._min_fraction - 1e-9 or not answer.solution.joint_trajectory.points:
            return self.fail(
                f"straight line: only {answer.fraction:.1%} of it can be moved "
                f"({error_name(answer.error_code.val)}), needed are {self._min_fraction:.1%}; the log of "
                "move_group says where it ends and why"
            )
        result = commander.execute_plan(answer.solution, stop_requested=self.preempt_requested)
        if self.preempt_requested():
            return self.stopped()
        return self.succeed() if result else self.fail(f"straight line: it was not moved: {result.reason}")

    def _target(self, commander: Any) -> PoseStamped:
        if self._offset is None:
            return fetch("pose", self._pose_name)
        link = commander.group.tip_link
        request = GetPositionFKRequest(fk_link_names=[link], robot_state=robot_state(commander.current_joints()))
        answer = request_service("compute_fk", GetPositionFK, request, TIMEOUT_S)
        if not answer.pose_stamped:
            raise CallError(
                f"'{rospy.resolve_name('compute_fk')}' does not know where link '{link}' is: "
                f"{error_name(answer.error_code.val)}"
            )
        return moved(answer.pose_stamped[0], self._offset, self._in_tip)

    def _path(self, commander: Any, target: PoseStamped) -> Any:
        request = self._request
        request.header.frame_id, request.waypoints = target.header.frame_id, [target.pose]
        request.group_name, request.link_name = commander.group_name, commander.group.tip_link
        request.cartesian_speed_limited_link = request.link_name if request.max_cartesian_speed else ""
        request.start_state = robot_state(commander.current_joints())
        return request_service("compute_cartesian_path", GetCartesianPath, request, TIMEOUT_S)


def moved(pose: PoseStamped, offset: Sequence[float], in_own_frame: bool) -> PoseStamped:
    """Returns a pose moved by an offset [m], given in the pose's own frame or in that of its header."""
    turn = pose.pose.orientation
    step = np.asarray(offset, dtype=float)
    if in_own_frame:
        step = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).apply(step)
    result = PoseStamped(header=pose.header, pose=Pose(orientation=turn))
    for axis, value in zip("xyz", step, strict=True):
        setattr(result.pose.position, axis, getattr(pose.pose.position, axis) + float(value))
    return result
