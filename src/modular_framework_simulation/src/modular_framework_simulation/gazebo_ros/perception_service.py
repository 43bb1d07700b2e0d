# SPDX-License-Identifier: BSD-3-Clause
"""Service that displaces a model in the planning scene, as a calibration error does."""

from __future__ import annotations

from typing import Any

from gazebo_msgs import srv

from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.gazebo_ros.endpoints import Endpoints
from modular_framework_simulation.loop.perception_errors import PerceptionErrors
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import WORLD_FRAMES

_NO_ROTATION = Pose().quaternion


class PerceptionService:
    """Serves /gazebo/set_perceived_pose_error (gazebo_msgs/SetModelState).

    The position of the request is the displacement of the perceived model in the world frame [m].

    Args:
        errors: Displacements of the perceived models.
    """

    def __init__(self, errors: PerceptionErrors) -> None:
        self._errors = errors

    def connect(self, endpoints: Endpoints) -> None:
        """Advertises the service."""
        endpoints.serve(ros_names.SET_PERCEIVED_POSE_ERROR, srv.SetModelState, self._set)

    def _set(self, request: Any) -> Any:
        state = request.model_state
        if not state.model_name:
            raise ValueError("the name of the model is empty; name a model, which may be spawned later")
        if state.reference_frame not in WORLD_FRAMES:
            raise ValueError(f"the reference frame is '{state.reference_frame}'; allowed: world")
        error = conversions.pose_from_msg(state.pose)
        if error.quaternion != _NO_ROTATION:
            raise ValueError("the error has a rotation; allowed: a displacement only")
        self._errors.set(state.model_name, error.position)
        x, y, z = error.position
        text = f"the planning scene shows '{state.model_name}' displaced by {x:g}, {y:g}, {z:g} m"
        return srv.SetModelStateResponse(True, text)
