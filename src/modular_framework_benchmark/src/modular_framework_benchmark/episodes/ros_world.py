# SPDX-License-Identifier: BSD-3-Clause
"""Puts the objects of an episode into the simulated world."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rospy
from gazebo_msgs.srv import SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from scipy.spatial.transform import Rotation

from modular_framework_ros.calls import call_service, wait_for_service

SPAWN_SERVICE = "/gazebo/spawn_sdf_model"
SERVICE_TIMEOUT_S = 60.0  # a mesh may have to be cut into convex parts


class WorldError(RuntimeError):
    """An object cannot be put into the world; the text says why."""


def spawn(entry: dict[str, Any]) -> None:
    """Puts an object into the world.

    Args:
        entry: `name`, `model`, `position` [m] and `rpy` [rad] in the world frame, see `PlacedObject`.

    Raises:
        WorldError: There is no such model, or the simulation refuses it.
        CallError: The simulation does not answer.
    """
    proxy = rospy.ServiceProxy(SPAWN_SERVICE, SpawnModel)
    wait_for_service(proxy, SERVICE_TIMEOUT_S)
    x, y, z, w = Rotation.from_euler("xyz", entry["rpy"]).as_quat()
    pose = Pose(Point(*entry["position"]), Quaternion(x, y, z, w))
    request = SpawnModel._request_class(entry["name"], _description(entry["model"]), "", pose, "world")
    answer = call_service(proxy, request, SERVICE_TIMEOUT_S)
    if not answer.success:
        raise WorldError(f"object '{entry['name']}' cannot be put into the world: {answer.status_message}")


def _description(model: str) -> str:
    path = Path(model)
    if not path.is_absolute():
        path = Path(str(rospy.get_param("/gazebo_model_path"))) / model / "model.sdf"
    try:
        return path.read_text()
    except OSError as error:
        raise WorldError(f"model '{model}': {path} cannot be read: {error.strerror}; correct the name") from error
