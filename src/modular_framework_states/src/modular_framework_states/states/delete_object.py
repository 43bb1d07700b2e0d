# SPDX-License-Identifier: BSD-3-Clause
"""A state that removes an object from the simulation."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

from modular_framework_core.scene.manage_object import request_to_delete
from modular_framework_core.scene.ros_manage_object import RefusedError, delete
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Named


class DeleteObject(FrameworkState):
    """Deletes an object from the simulation, the type map and the collision matrix.

    Args:
        object_name: Name of the object.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(self, object_name: Annotated[str, Named("model")], **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._object_name = object_name

    def execute(self, userdata: Any) -> str:
        """Deletes the object."""
        try:
            delete(request_to_delete(self._object_name))
        except RefusedError as error:
            return self.fail(f"object '{self._object_name}': {error}")
        return self.succeed()
