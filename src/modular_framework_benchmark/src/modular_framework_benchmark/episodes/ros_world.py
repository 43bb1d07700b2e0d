# SPDX-License-Identifier: BSD-3-Clause
"""Spawns the objects of an episode in the simulated world, and asks the simulation for a judgement of the result."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import rosgraph
import rospy
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import GetModelState, GetModelStateRequest, SetModelState, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from std_srvs.srv import SetBool, SetBoolRequest, Trigger, TriggerRequest

from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_benchmark.records.perturbation import ObjectPerturbation
from modular_framework_core.files.model_files import model_file
from modular_framework_core.task_constructor.known_names import MODEL_PATH
from modular_framework_ros.calls import CallError, request_service
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.model_variants import changed_model, read_scaled
from modular_framework_urdf.rotations import quaternion_from_rpy

MODEL_STATE_SERVICE = "/gazebo/get_model_state"
SPAWN_SERVICE, REFEREE_SERVICE, RECORD_SERVICE, PERCEPTION_SERVICE = (
    "/gazebo/spawn_sdf_model",
    "/gazebo/referee",
    "/gazebo/record_world",
    "/gazebo/set_perceived_pose_error",
)
SIMULATION_NODE, TASK_NODE = "/gazebo", "/task"
ABORTED_TIMEOUT_S = 5.0
"""Maximum duration of a call after an aborted episode, because the simulation may hang [s]."""
SERVICE_TIMEOUT_S = 60.0  # long enough for a convex decomposition of a mesh

REST_M_S, REST_RAD_S = 0.02, 0.2
"""Highest speeds of an object at rest."""
REST_PERIOD_S = 0.1
"""Period in which the speeds are checked [s, simulated time]."""


class WorldError(RuntimeError):
    """An object cannot be spawned; the message gives the reason."""


def spawn(placed: PlacedObject) -> None:
    """Spawns an object with its perturbation in the world.

    Args:
        placed: Object with its pose.

    Raises:
        WorldError: The model does not exist or cannot be perturbed, or the simulation rejects it.
        CallError: The simulation does not answer.
    """
    if placed.perturbed is not None and any(placed.perturbed.pose_error):
        _displace_perceived(placed.name, placed.perturbed.pose_error)  # first, so that the true pose is never shown
    x, y, z, w = quaternion_from_rpy(*placed.rpy)
    pose = Pose(Point(*placed.xyz), Quaternion(x, y, z, w))
    request = SpawnModel._request_class(placed.name, _description(placed), "", pose, "world")
    response = request_service(SPAWN_SERVICE, SpawnModel, request, SERVICE_TIMEOUT_S)
    if not response.success:
        raise WorldError(f"object '{placed.name}' cannot be spawned: {response.status_message}")


def moving_objects(names: Iterable[str]) -> list[str]:
    """Returns the objects that move faster than an object at rest.

    Args:
        names: Names of the objects.

    Raises:
        CallError: The simulation does not answer.
    """
    return [name for name in names if _moves(name)]


def wait_for_rest(names: Collection[str], longest_s: float, sleep: Callable[[float], None]) -> None:
    """Waits until objects are at rest, or for the longest time.

    Args:
        names: Names of the objects.
        longest_s: Longest time [s, simulated time].
        sleep: Function that waits for a simulated time [s].

    Raises:
        CallError: The simulation does not answer.
    """
    for _ in range(round(longest_s / REST_PERIOD_S)):
        if not moving_objects(names):
            return
        sleep(REST_PERIOD_S)


def _moves(name: str) -> bool:
    request = GetModelStateRequest(model_name=name)
    twist = request_service(MODEL_STATE_SERVICE, GetModelState, request, SERVICE_TIMEOUT_S).twist
    linear, angular = (math.hypot(each.x, each.y, each.z) for each in (twist.linear, twist.angular))
    return linear > REST_M_S or angular > REST_RAD_S


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


def judge(timeout_s: float = SERVICE_TIMEOUT_S) -> Judgement:
    """Requests the state of the world from the simulation.

    Args:
        timeout_s: Maximum duration of the call [s].

    Raises:
        InterferenceError: Another node offers the referee's service.
        WorldError, CallError: The simulation does not answer.
    """
    return Judgement(**json.loads(_ask_simulation(REFEREE_SERVICE, Trigger, TriggerRequest(), timeout_s)))


def aborted_interference(since: int) -> str:
    """Returns the interference in an aborted episode since an intervention; "" if the simulation hangs.

    Args:
        since: Number of the intervention.
    """
    try:
        return judge(ABORTED_TIMEOUT_S).interference(since)
    except InterferenceError as error:
        return str(error)
    except (WorldError, CallError) as error:
        rospy.logwarn("the aborted episode is judged without the simulation: %s", error)
        return ""


def begin_world_record() -> None:
    """Begins a record of the world in the simulation.

    Raises:
        InterferenceError: Another node offers the service.
        WorldError, CallError: The simulation does not answer.
    """
    _ask_simulation(RECORD_SERVICE, SetBool, SetBoolRequest(data=True), SERVICE_TIMEOUT_S)


def end_world_record(must_answer: bool) -> dict[str, Any]:
    """Ends the record of the world and returns it.

    Args:
        must_answer: Whether a missing answer is an error; otherwise the record is then empty.

    Raises:
        InterferenceError: Another node offers the service.
        WorldError, CallError: The simulation does not answer.
    """
    timeout_s = SERVICE_TIMEOUT_S if must_answer else ABORTED_TIMEOUT_S
    try:
        return dict(json.loads(_ask_simulation(RECORD_SERVICE, SetBool, SetBoolRequest(data=False), timeout_s)))
    except (WorldError, CallError):
        if must_answer:
            raise
        return {"samples": [], "boxes": {}, "robots": []}


def _ask_simulation(service: str, kind: Any, request: Any, timeout_s: float) -> str:
    """Returns the message with which the simulation answers; no other node may answer in its place."""
    services = rosgraph.Master(rospy.get_name()).getSystemState()[2]
    nodes = next((nodes for name, nodes in services if name == service), [])
    if nodes and nodes != [SIMULATION_NODE]:
        raise InterferenceError(f"'{service}' is answered by '{', '.join(nodes)}', not by the simulation")
    response = request_service(service, kind, request, timeout_s)
    if not response.success:
        raise WorldError(f"the simulation does not answer '{service}': {response.message}")
    return str(response.message)


def _displace_perceived(name: str, error: tuple[float, ...]) -> None:
    """Displaces an object in the planning scene.

    Args:
        name: Name of the object.
        error: Perceived minus true position in the world frame, x and y [m].
    """
    state = ModelState(model_name=name, reference_frame="world")
    state.pose.position.x, state.pose.position.y = error
    request = SetModelState._request_class(state)
    response = request_service(PERCEPTION_SERVICE, SetModelState, request, SERVICE_TIMEOUT_S)
    if not response.success:
        raise WorldError(f"object '{name}' cannot be displaced in the planning scene: {response.status_message}")


def _description(placed: PlacedObject) -> str:
    """Returns the SDF text of an object with its size and its perturbation."""
    path = model_file(placed.model, str(rospy.get_param(MODEL_PATH, "")))
    perturbed = placed.perturbed or ObjectPerturbation()
    try:
        text = read_scaled(path, placed.scale)
        return changed_model(
            text,
            str(path),
            mass=perturbed.mass,
            friction=perturbed.friction,
            centre_of_mass=perturbed.centre_of_mass,
        )
    except (OSError, DescriptionError) as error:
        raise WorldError(f"model '{placed.model}': {path} cannot be used: {error}; correct the name") from error
