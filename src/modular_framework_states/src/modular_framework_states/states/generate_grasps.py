# SPDX-License-Identifier: BSD-3-Clause
"""A state that has the method generate grasps of one object."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Unpack

import rospy
import rosservice
from std_srvs.srv import Trigger, TriggerRequest

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Positive
from modular_framework_core.state_api.option_uses import FROM_USERDATA, Key, Named
from modular_framework_ros.calls import CallError, request_service, wait_until

OBJECT_KEY = "selected_object"
OBJECT_PARAMETER = "object_name"
SERVICES = {False: "generate_grasps", True: "refresh_grasps"}
SERVICE_WAIT_S, POLL_S = 10.0, 0.1


class GenerateGrasps(FrameworkState):
    """Has the method generate grasps of one object; positive once grasps are stored.

    The state sets the parameter ``object_name`` of the method's node during the call.

    Args:
        object_name: Model or planning scene object to grasp; ``userdata`` for the input key ``selected_object``, empty
            for all objects in the crop box.
        keep_grasps: Whether remaining grasps are kept if no object has moved since the last generation.
        timeout: Maximum duration of the generation [s].
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(
        self,
        object_name: Annotated[str, Key("input", OBJECT_KEY, when=FROM_USERDATA), Named("model")] = "",
        keep_grasps: bool = False,
        timeout: Positive = 60.0,
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._object, self._service, self._timeout_s = str(object_name), SERVICES[bool(keep_grasps)], float(timeout)

    def execute(self, userdata: Any) -> str:
        """Calls the method for the object."""
        name = userdata.selected_object if self._object == FROM_USERDATA else self._object
        if self._object == FROM_USERDATA and not name:
            return self.fail(f"userdata '{OBJECT_KEY}' is empty; select an object first")
        try:
            with _object_of_method(self._service, name):
                response = request_service(self._service, Trigger, TriggerRequest(), self._timeout_s)
        except CallError as error:
            return self.fail(str(error))
        if not response.success:
            return self.fail(f"grasps of '{name or 'any object'}': {response.message}")
        return self.succeed()


@contextmanager
def _object_of_method(service: str, name: str) -> Iterator[None]:
    """Sets the object that the node of a service grasps, and restores the parameter afterwards.

    Args:
        service: Service of the method.
        name: Object; "" to leave the parameter unchanged.

    Raises:
        CallError: No node offers the service.
    """
    if not name:
        yield
        return
    resolved = rospy.resolve_name(service)
    if not wait_until(lambda: rosservice.get_service_node(resolved) is not None, SERVICE_WAIT_S, POLL_S):
        raise CallError(f"no node offers the service '{resolved}' after {SERVICE_WAIT_S:g} s; start a grasp method")
    parameter = f"{rosservice.get_service_node(resolved)}/{OBJECT_PARAMETER}"
    before = rospy.get_param(parameter, "")
    rospy.set_param(parameter, name)
    try:
        yield
    finally:
        rospy.set_param(parameter, before)
