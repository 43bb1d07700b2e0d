# SPDX-License-Identifier: BSD-3-Clause
"""A state that plans how the held object is put down."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

import rospy
from moveit_msgs.msg import PlaceAction, PlaceGoal
from sensor_msgs.msg import JointState

from modular_framework_core.commander.moveit_requests import error_name
from modular_framework_core.commander.robot_groups import RobotModelError
from modular_framework_core.grasp_generation.convex_bodies import ShapeError
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObjectError
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits, NotNegative, Positive
from modular_framework_core.state_api.option_uses import FROM_USERDATA, Key, Named
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.calls import CallError, wait_for_action, wait_for_result
from modular_framework_states.grasp_stages import StageError
from modular_framework_states.manager_clients import ManagerError, store_plan
from modular_framework_states.manipulator_postures import posture_positions
from modular_framework_states.place_goals import PlaceScene, place_locations, read_place_scene
from modular_framework_states.place_poses import PlaceError, PlaceLimits, place_poses, read_region, upper_face

PLACE_ACTION, REGIONS_PARAMETER = "place", "/regions"
SERVER_TIMEOUT_S, CANCEL_S = 10.0, 30.0
FAULTS = (CallError, ManagerError, PlaceError, RobotModelError, SceneObjectError, ShapeError, StageError)
GAP_M = 0.002
"""Release height at which a moving object does not touch the support [m]."""


class PlanPlace(FrameworkState):
    """Plans to put the held object down; positive once two plans are stored: down to the place, and back from it.

    The object stands in one of its stable poses with the centre of its box in the region, as near as possible to the
    orientation at the grasp and to the centre of the region. The planning scene gives the pose of the object in the
    hand. The approach comes from above; the retreat reverses the approach of the grasp, with the fingers open, so that
    the hand does not tip the object. The action ``place`` of move_group plans the motions.

    Args:
        support: Model or planning scene object that the object is put on; ``userdata`` for the input key
            ``selected_support``.
        region: Name of a region of the parameter ``/regions``; empty for the whole surface.
        overhang: Distance by which the lower face of the object may leave the support [m].
        align: Whether the longest edge of the lower face is parallel or perpendicular to the longest edge of the
            support's upper face, as for blocks of a tower.
        max_tilt: Largest angle by which the object may be tilted with respect to its orientation at the grasp [rad].
        release_height: Height of the object above the support at the release [m]; more than the height of a bin's walls
            drops the object into the bin.
        posture: Posture of the fingers after the release, a state of the manipulator's planning group.
        approach_plan: Name of the stored plan down to the place.
        retreat_plan: Name of the stored plan back from the place.
        timeout: Maximum planning time [s].
        **keys: Outcomes and userdata keys of any state; the input key ``selected_grasp`` is the grasp that holds the
            object, and the output key ``selected_joint_state`` receives the start of the approach.
    """

    DEFAULT_IO_KEYS = ("arm_commander",)

    def __init__(
        self,
        support: Annotated[str, Key("input", "selected_support", when=FROM_USERDATA), Named("model")],
        region: Annotated[str, Named("region")] = "",
        overhang: NotNegative = 0.0,
        align: bool = False,
        max_tilt: Annotated[float, Limits(at_least=0.0, at_most=3.15)] = 0.3,
        release_height: NotNegative = GAP_M,
        posture: Annotated[str, Named("posture")] = "open",
        approach_plan: Annotated[str, Named("plan", made=True)] = "place_approach",
        retreat_plan: Annotated[str, Named("plan", made=True)] = "place_retreat",
        timeout: Positive = 10.0,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._support, self._region, self._posture = support, region, posture
        self._limits = PlaceLimits(
            max_tilt_rad=float(max_tilt), overhang_m=float(overhang), gap_m=float(release_height), aligned=bool(align)
        )
        self._plan_names, self._timeout_s = {"approach": approach_plan, "retreat": retreat_plan}, float(timeout)

    def execute(self, userdata: Any) -> str:
        """Computes place poses, requests the plans of the motions, and stores the plans."""
        commander, grasp = userdata.arm_commander, userdata.selected_grasp
        if grasp is None:
            return self.fail("userdata 'selected_grasp' is empty; select the grasp that holds the object first")
        support = userdata.selected_support if self._support == FROM_USERDATA else self._support
        if not support:
            return self.fail("userdata 'selected_support' is empty; select the support first")
        try:
            scene = read_place_scene(commander, grasp, support)
            result, text = self._plan_place(commander, self._goal(commander, scene))
            if self.preempt_requested():
                return self.stopped()
            if result is None or result.error_code.val != result.error_code.SUCCESS:
                code = "no result" if result is None else error_name(result.error_code.val)
                return self.fail(f"place '{scene.held}' on '{scene.support}': {code}: {text}")
            stages = dict(zip(result.trajectory_descriptions, result.trajectory_stages, strict=True))
            for stage, name in self._plan_names.items():
                store_plan(stages[stage], name)
        except FAULTS as error:
            return self.fail(f"place on '{support}': {error}")
        start = stages["approach"].joint_trajectory
        userdata.selected_joint_state = JointState(name=start.joint_names, position=start.points[0].positions)
        return self.succeed()

    def _goal(self, commander: Any, scene: PlaceScene) -> PlaceGoal:
        region = read_region(self._region, rospy.get_param(REGIONS_PARAMETER, {}))
        poses = place_poses(
            scene.solids,
            scene.orientation,
            upper_face(scene.support_solids, region),
            region,
            self._limits,
        )
        goal = PlaceGoal(
            group_name=commander.group_name,
            attached_object_name=scene.held,
            place_locations=place_locations(scene, poses, posture_positions(self._posture)),
            support_surface_name=scene.support,
            allowed_planning_time=self._timeout_s,
        )
        goal.planning_options.plan_only = True
        return goal

    def _plan_place(self, commander: Any, goal: PlaceGoal) -> tuple[Any, str]:
        """Returns the result of the action, or None without a result, and the text of the action."""
        client = SteadyActionClient(PLACE_ACTION, PlaceAction)
        wait_for_action(client, PLACE_ACTION, SERVER_TIMEOUT_S)
        client.send_goal(goal)
        wait_for_result(client, self._timeout_s + CANCEL_S, self.preempt_requested)
        return client.get_result(), client.get_goal_status_text()
