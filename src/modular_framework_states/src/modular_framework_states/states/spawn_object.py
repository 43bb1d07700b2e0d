# SPDX-License-Identifier: BSD-3-Clause
"""A state that adds an object to the simulation."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

import rospy

from modular_framework_core.scene.manage_object import ObjectRequestError, request_to_spawn
from modular_framework_core.scene.ros_manage_object import RefusedError, spawn
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Vector
from modular_framework_core.state_api.option_uses import Named


class SpawnObject(FrameworkState):
    """Spawns an object; positive if simulation, type map and collision matrix all contain it.

    Args:
        object_type: Folder of the model below the folder of models (parameter ``gazebo_model_path``).
        object_name: Name of the object; empty for the name of the type.
        position: Position (x, y, z) [m].
        orientation: Roll, pitch and yaw [rad].
        reference_frame: Frame of the pose.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(
        self,
        # also the name of an object without a name
        object_type: Annotated[str, Named("object_type"), Named("model", made=True)],
        object_name: Annotated[str, Named("model", made=True)] = "",
        position: Vector = (0.0, 0.0, 0.0),
        orientation: Vector = (0.0, 0.0, 0.0),
        reference_frame: str = "world",
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._object_type, self._object_name = object_type, object_name or object_type
        self._position, self._orientation = tuple(position), tuple(orientation)
        self._frame = reference_frame

    def execute(self, userdata: Any) -> str:
        """Spawns the object."""
        try:
            spawn(
                request_to_spawn(
                    self._object_name,
                    self._object_type,
                    position_m=self._position,
                    rpy_rad=self._orientation,
                    reference_frame=self._frame,
                    model_path=str(rospy.get_param("gazebo_model_path", "")),
                )
            )
        except (ObjectRequestError, RefusedError) as error:
            return self.fail(f"object '{self._object_name}': {error}")
        return self.succeed()
