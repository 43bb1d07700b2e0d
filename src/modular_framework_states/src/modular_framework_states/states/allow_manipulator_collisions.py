# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task say what the manipulator may touch while the next motions are planned."""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import rospy
from moveit_msgs.msg import PlanningScene
from moveit_msgs.srv import ApplyPlanningScene, ApplyPlanningSceneRequest

from modular_framework_core.framework_state import FrameworkState
from modular_framework_core.ros_calls import CallError, call_service, wait_for_service
from modular_framework_core.srv import GetModifiedACM, GetModifiedACMRequest
from modular_framework_states.manager_clients import ManagerError

MODIFICATIONS = {"": GetModifiedACMRequest.NOTHING,
                 "self-collision": GetModifiedACMRequest.MANIPULATOR_SELF_COLLISION,
                 "object-collision": GetModifiedACMRequest.MANIPULATOR_OBJECT_COLLISION}
FROM_USERDATA = "userdata"
SERVICE_TIMEOUT_S = 10.0


class AllowManipulatorCollisions(FrameworkState):
    """Changes which collisions of the manipulator are allowed; positive once the planning scene has taken the change.

    Args:
        allow: True allows, False restores what the robot's description says.
        collision_type: self-collision, object-collision, or nothing to apply the matrix as it stands.
        objects: Names of the objects; none means all that are known: those that were added and, in simulation, every
            object that is free to move. ``userdata`` takes the object of ``selected_grasp``.
        outcomes: First positive, last negative.
        input_keys: Userdata that is read.
        output_keys: Userdata that is written.
        io_keys: Userdata that is read and written.
    """

    def __init__(self, allow: bool, collision_type: Literal["", "self-collision", "object-collision"] = "",
                 objects: Sequence[str] | str = (),
                 outcomes: Sequence[str] = ("success", "fail"), input_keys: Sequence[str] = (),
                 output_keys: Sequence[str] = (), io_keys: Sequence[str] = ()) -> None:
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        if collision_type not in MODIFICATIONS:
            raise ValueError(f"AllowManipulatorCollisions: collision_type is '{collision_type}', allowed are "
                             f"{list(MODIFICATIONS)}")
        self._modification, self._allow = MODIFICATIONS[collision_type], bool(allow)
        self._objects = [objects] if isinstance(objects, str) else list(objects)

    def execute(self, userdata: Any) -> str:
        """Fetches the changed matrix and applies it."""
        get_matrix = rospy.ServiceProxy("get_modified_acm", GetModifiedACM)
        apply_scene = rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)
        try:
            request = GetModifiedACMRequest(modification=self._modification, allow_collision=self._allow,
                                            objects=self._named_objects(userdata))
            for proxy in (get_matrix, apply_scene):
                wait_for_service(proxy, SERVICE_TIMEOUT_S)
            answer = call_service(get_matrix, request, SERVICE_TIMEOUT_S)
            if not answer.success:
                return self.fail(f"service '{get_matrix.resolved_name}' refused the change; its node logged the reason")
            scene = PlanningScene(is_diff=True, allowed_collision_matrix=answer.acm)
            scene.robot_state.is_diff = True
            applied = call_service(apply_scene, ApplyPlanningSceneRequest(scene=scene), SERVICE_TIMEOUT_S)
        except (ManagerError, CallError) as error:
            return self.fail(str(error))
        if not applied.success:
            return self.fail(f"service '{apply_scene.resolved_name}' did not take the collision matrix of "
                             f"{len(answer.acm.entry_names)} entries; its node logged the reason")
        return self.succeed()

    def _named_objects(self, userdata: Any) -> list[str]:
        if self._objects != [FROM_USERDATA]:
            return self._objects
        if "selected_grasp" not in self.get_registered_input_keys():
            raise ManagerError("the object is to be taken from userdata, but 'selected_grasp' is not among the input "
                               f"keys {sorted(self.get_registered_input_keys())}")
        name = userdata.selected_grasp.object_id if userdata.selected_grasp is not None else ""
        if not name:
            raise ManagerError("userdata 'selected_grasp' names no object; select a grasp with an object_id first, or "
                               "give the objects by name")
        return [name]
