# SPDX-License-Identifier: BSD-3-Clause
"""Spawns the objects of an episode in the simulated world, and asks the simulation for a judgement of the result."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rosgraph
import rospy
from gazebo_msgs.srv import SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from std_srvs.srv import Trigger, TriggerRequest

from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_ros.calls import request_service
from modular_framework_urdf.rotations import quaternion_from_rpy

SPAWN_SERVICE, REFEREE_SERVICE = "/gazebo/spawn_sdf_model", "/gazebo/referee"
SIMULATION_NODE, TASK_NODE = "/gazebo", "/task"
SERVICE_TIMEOUT_S = 60.0  # long enough for a convex decomposition of a mesh


class WorldError(RuntimeError):
    """An object cannot be spawned; the message gives the reason."""


def spawn(placed: PlacedObject) -> None:
    """Spawns an object in the world.

    Args:
        placed: Object with its pose.

    Raises:
        WorldError: The model does not exist, or the simulation rejects it.
        CallError: The simulation does not answer.
    """
    x, y, z, w = quaternion_from_rpy(*placed.rpy)
    pose = Pose(Point(*placed.xyz), Quaternion(x, y, z, w))
    request = SpawnModel._request_class(placed.name, _description(placed.model), "", pose, "world")
    response = request_service(SPAWN_SERVICE, SpawnModel, request, SERVICE_TIMEOUT_S)
    if not response.success:
        raise WorldError(f"object '{placed.name}' cannot be spawned: {response.status_message}")


@dataclass(frozen=True, slots=True)
class Judgement:
    """State of the world from the simulation's own process, independent of topics.

    Attributes:
        held: Names of the objects that touch two fingers of a gripper.
        poses: Position [m] and quaternion (xyzw) of each model in the world frame.
        interventions: Latest changes of the world outside its physics: `number`, `time_s`, `what`, `caller`.
    """

    held: Collection[str]
    poses: Mapping[str, list[float]]
    interventions: list[dict[str, Any]]

    @property
    def number(self) -> int:
        """Number of the latest intervention; 0 without interventions."""
        return int(self.interventions[-1]["number"]) if self.interventions else 0

    def interference(self, since: int) -> str:
        """Returns the changes of the world by nodes other than the task since an intervention; "" for none."""
        foreign = [each for each in self.interventions if each["number"] > since and each["caller"] != TASK_NODE]
        if not foreign:
            return ""
        first = foreign[0]
        caller = f" by a node named '{first['caller']}'" if first["caller"] else ""
        more = f", and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        return f"the world was changed outside its physics{caller}: {first['what']} at {first['time_s']:.3f} s{more}"


class InterferenceError(WorldError):
    """An episode is invalid, because the basis of its judgement does not come from the simulation."""


def judge() -> Judgement:
    """Requests the state of the world from the simulation.

    Raises:
        InterferenceError: Another node offers the referee's service.
        WorldError, CallError: The simulation does not answer.
    """
    services = rosgraph.Master(rospy.get_name()).getSystemState()[2]
    nodes = next((nodes for name, nodes in services if name == REFEREE_SERVICE), [])
    if nodes and nodes != [SIMULATION_NODE]:
        raise InterferenceError(f"'{REFEREE_SERVICE}' is answered by '{', '.join(nodes)}', not by the simulation")
    response = request_service(REFEREE_SERVICE, Trigger, TriggerRequest(), SERVICE_TIMEOUT_S)
    if not response.success:
        raise WorldError(f"the simulation does not judge the world: {response.message}")
    return Judgement(**json.loads(response.message))


def _description(model: str) -> str:
    path = Path(model)
    if not path.is_absolute():
        path = Path(str(rospy.get_param("/gazebo_model_path"))) / model / "model.sdf"
    try:
        return path.read_text()
    except OSError as error:
        raise WorldError(f"model '{model}': {path} cannot be read: {error.strerror}; correct the name") from error
