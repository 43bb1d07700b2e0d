# SPDX-License-Identifier: BSD-3-Clause
"""A state that changes the allowed collisions of the manipulator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Unpack

import rospy

from modular_framework_core.managers.ros_acm_services import apply_matrix
from modular_framework_core.srv import GetModifiedACM, GetModifiedACMRequest, ModifyACM, ModifyACMRequest
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import FROM_USERDATA, Key, Named
from modular_framework_ros.calls import CallError, request_service
from modular_framework_states.manager_clients import ManagerError

MODIFICATIONS = {
    "": GetModifiedACMRequest.NOTHING,
    "self-collision": GetModifiedACMRequest.MANIPULATOR_SELF_COLLISION,
    "object-collision": GetModifiedACMRequest.MANIPULATOR_OBJECT_COLLISION,
}
LINK_MODIFICATIONS = {
    "self-collision": ModifyACMRequest.ROBOT_SELF_COLLISION,
    "object-collision": ModifyACMRequest.ROBOT_OBJECT_COLLISION,
}
Objects = Annotated[Sequence[str] | str, Key("input", "selected_grasp", when=FROM_USERDATA), Named("model")]
SERVICE_TIMEOUT_S = 10.0


class AllowManipulatorCollisions(FrameworkState):
    """Changes the allowed collisions of the manipulator; positive once the planning scene has accepted the change.

    Args:
        allow: True allows collisions, False restores the allowed collisions of the robot description.
        collision_type: Self-collision, object-collision, or empty to apply the current matrix.
        objects: Names of the objects; empty for all known objects: those that were added and, in simulation, all
            movable objects. ``userdata`` stands for the object of ``selected_grasp``.
        links: Names of robot links, instead of the manipulator's links.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(
        self,
        allow: bool,
        collision_type: Literal["", "self-collision", "object-collision"] = "",
        objects: Objects = (),
        links: Sequence[str] = (),
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        if links and not collision_type:
            raise ValueError("AllowManipulatorCollisions: links needs a collision_type; give one")
        self._type, self._allow, self._links = collision_type, bool(allow), list(links)
        self._objects = [objects] if isinstance(objects, str) else list(objects)

    def execute(self, userdata: Any) -> str:
        """Changes the matrix and applies it."""
        try:
            objects = self._named_objects(userdata)
            if self._links:
                _call_manager(
                    "modify_acm",
                    ModifyACM,
                    ModifyACMRequest(LINK_MODIFICATIONS[self._type], self._links, objects, self._allow, True),
                )
                return self.succeed()
            response = _call_manager(
                "get_modified_acm",
                GetModifiedACM,
                GetModifiedACMRequest(MODIFICATIONS[self._type], objects, self._allow),
            )
            apply_matrix(response.acm, SERVICE_TIMEOUT_S)
        except (ManagerError, CallError) as error:
            return self.fail(str(error))
        return self.succeed()

    def _named_objects(self, userdata: Any) -> list[str]:
        if self._objects != [FROM_USERDATA]:
            return self._objects
        if "selected_grasp" not in self.get_registered_input_keys():
            raise ManagerError(
                "the object is taken from userdata, but 'selected_grasp' is not among the input "
                f"keys {sorted(self.get_registered_input_keys())}; add the key"
            )
        name = userdata.selected_grasp.object_id if userdata.selected_grasp is not None else ""
        if not name:
            raise ManagerError(
                "userdata 'selected_grasp' names no object; select a grasp with an object_id first, or "
                "give the objects by name"
            )
        return [name]


def _call_manager(name: str, service_type: Any, request: Any) -> Any:
    """Calls a service of the collision matrix manager; raises CallError without a response or on rejection."""
    response = request_service(name, service_type, request, SERVICE_TIMEOUT_S)
    if not response.success:
        raise CallError(f"service '{rospy.resolve_name(name)}' refused the change; its node logged the reason")
    return response
