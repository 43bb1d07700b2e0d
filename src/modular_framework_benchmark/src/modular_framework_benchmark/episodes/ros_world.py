# SPDX-License-Identifier: BSD-3-Clause
"""Puts the objects of an episode into the simulated world, and has the world judge what became of them."""

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
from scipy.spatial.transform import Rotation
from std_srvs.srv import Trigger, TriggerRequest

from modular_framework_ros.calls import call_service, request_service, wait_for_service

SPAWN_SERVICE, REFEREE_SERVICE = "/gazebo/spawn_sdf_model", "/gazebo/referee"
SIMULATION_NODE, TASK_NODE = "/gazebo", "/task"
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


@dataclass(frozen=True, slots=True)
class Judgement:
    """What the simulation's own process knows of the world; no topic is read for it.

    Attributes:
        held: Names of the objects that touch two fingers of a gripper.
        poses: Position [m] and quaternion (xyzw) of each model in the world frame.
        interventions: The latest changes of the world beside its physics, with `number`, `time_s`, `what`, `caller`.
    """

    held: Collection[str]
    poses: Mapping[str, list[float]]
    interventions: list[dict[str, Any]]

    @property
    def number(self) -> int:
        """The number of the latest intervention; 0 without one."""
        return int(self.interventions[-1]["number"]) if self.interventions else 0

    def foul(self, since: int) -> str:
        """Returns what was changed in the world since an intervention by others than the task; "" for nothing."""
        foreign = [each for each in self.interventions if each["number"] > since and each["caller"] != TASK_NODE]
        if not foreign:
            return ""
        first = foreign[0]
        caller = f" by '{first['caller']}', as it calls itself" if first["caller"] else ""
        more = f", and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        return f"the world was changed beside its physics{caller}: {first['what']} at {first['time_s']:.3f} s{more}"


class FoulError(WorldError):
    """An episode is invalid: what it is judged by does not come from the simulation; the text says from where."""


def judge() -> Judgement:
    """Asks the simulation what became of the world.

    Raises:
        FoulError: Another node offers the referee's service.
        WorldError, CallError: The simulation does not answer.
    """
    services = rosgraph.Master(rospy.get_name()).getSystemState()[2]
    nodes = next((nodes for name, nodes in services if name == REFEREE_SERVICE), [])
    if nodes and nodes != [SIMULATION_NODE]:
        raise FoulError(f"'{REFEREE_SERVICE}' is answered by '{', '.join(nodes)}', not by the simulation")
    answer = request_service(REFEREE_SERVICE, Trigger, TriggerRequest(), SERVICE_TIMEOUT_S)
    if not answer.success:
        raise WorldError(f"the simulation does not judge the world: {answer.message}")
    return Judgement(**json.loads(answer.message))


def _description(model: str) -> str:
    path = Path(model)
    if not path.is_absolute():
        path = Path(str(rospy.get_param("/gazebo_model_path"))) / model / "model.sdf"
    try:
        return path.read_text()
    except OSError as error:
        raise WorldError(f"model '{model}': {path} cannot be read: {error.strerror}; correct the name") from error
