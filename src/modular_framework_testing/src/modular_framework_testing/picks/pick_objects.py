# SPDX-License-Identifier: BSD-3-Clause
"""Runs the shipped task on one object after another in a running simulation, and prints each result.

Run as a node beside `start_framework.launch ... end_with_task:=false`:

    python3 -m modular_framework_testing.picks.pick_objects TASK_SCRIPT [CASE ...]

Every line it prints is a JSON object: case, exit_code, lifted_m, held, log. The cases, all by default, are the objects
of the standard set and `second_try`: a can whose first two grasps are bad. The gripper cannot lift the can with the
first grasp; with the second, the fingers touch the can before they close.
"""

from __future__ import annotations

import copy
import json
import math
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy
from gazebo_msgs.srv import DeleteModel, GetModelState, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from modular_framework_core.files.model_files import model_file
from modular_framework_core.srv import AddStandardisedGrasp, GetStandardisedGrasp

# model -> height of its frame above the surface it stands on [m] (the frame is in the middle of the model)
OBJECTS = {
    "cube": 0.025,
    "wood_block": 0.05,
    "can": 0.0575,
    "tube": 0.07,
    "ball": 0.032,
    "l_bracket": 0.04,
    "tea_box": 0.06,
    "mug": 0.045,
}
SECOND_TRY = "second_try"
TABLE_TOP_M = 0.84
PLACE_XY_M, YAW_RAD = (0.05, 0.5), 0.3
WAIT_S, TASK_S = 120.0, 240.0
TOO_DEEP_M, TOUCHING_POSITION = 0.0275, 1.0485  # the can is between the proximal phalanges, 33 mm from the middle
INTO_THE_TABLE_M = 0.008


def wait(condition: Callable[[], Any], what: str) -> None:
    """Waits for a condition in wall time.

    Raises:
        TimeoutError: The condition does not hold within `WAIT_S`.
    """
    end = time.monotonic() + WAIT_S
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"not within {WAIT_S:g} s: {what}")
        time.sleep(0.05)


def service(name: str, kind: Any) -> Any:
    """Waits for a service and returns its proxy."""
    rospy.wait_for_service(name, WAIT_S)
    return rospy.ServiceProxy(name, kind)


def spawn(name: str, model: str, xy: tuple[float, float], yaw: float) -> str:
    """Puts a model on the table of ur5_table.world.

    Args:
        name: Name of the object.
        model: A key of `OBJECTS`.
        xy: Position on the table, in the world [m].
        yaw: Angle about the vertical [rad].

    Returns:
        The reason of a failure, or "".
    """
    place = service("/gazebo/spawn_sdf_model", SpawnModel)
    text = model_file(model, rospy.get_param("/gazebo_model_path")).read_text()
    pose = Pose(
        Point(*xy, TABLE_TOP_M + OBJECTS[model] + 0.001), Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    )
    answer = place(name, text, "", pose, "world")
    return "" if answer.success else f"could not spawn {model}: {answer.status_message}"


def height(name: str) -> float:
    """Returns the height of a model [m]."""
    return float(service("/gazebo/get_model_state", GetModelState)(name, "world").pose.position.z)


class Picker:
    """Puts objects on the table and runs the task to pick them."""

    def __init__(self, script: str) -> None:
        self._script, self._signals = script, 0
        self._outcomes: list[str] = []
        rospy.Subscriber("grasp_generated", Bool, self._on_signal)
        rospy.Subscriber("task_outcome", String, lambda message: self._outcomes.append(message.data))

    def _on_signal(self, message: Bool) -> None:
        self._signals += 1

    def pick(self, case: str, model: str, task_runs: bool) -> dict[str, Any]:
        """Runs the task to pick an object.

        Args:
            case: Name of the case.
            model: A key of `OBJECTS`.
            task_runs: Whether the task of the launch file already runs; otherwise the task is started.

        Returns:
            The fields of the printed line.
        """
        name, signals = f"{case}_1", self._signals
        problem = spawn(name, model, PLACE_XY_M, YAW_RAD)
        if problem:
            return {"case": case, "log": problem}
        if task_runs:
            wait(lambda: self._signals > signals, f"grasps of {name}")
        else:
            wait(lambda: in_scene(case), f"{name} in the planning scene")
            service("refresh_grasps", Trigger)()
        if case == SECOND_TRY:
            spoil_first_grasps()
        before, log, exit_code = height(name), "", 0
        if task_runs:
            wait(lambda: self._outcomes, "the end of the task of the launch file")
            exit_code = 0 if self._outcomes[0] == "successful_pipeline" else 1
        else:
            command = ["rosrun", "modular_framework_core", "run_task", self._script, f"__name:=pick_{case}"]
            run = subprocess.run(command, capture_output=True, text=True, timeout=TASK_S, check=False)
            exit_code, log = run.returncode, run.stdout + run.stderr
        held = rospy.wait_for_message("/gazebo/grasped_object", String, WAIT_S).data
        return {
            "case": case,
            "exit_code": exit_code,
            "lifted_m": height(name) - before,
            "held": held == name,
            "log": log[-30000:],
        }

    def clear(self, case: str) -> None:
        """Removes the object, and waits until it is no longer in the planning scene."""
        service("/gazebo/delete_model", DeleteModel)(f"{case}_1")
        wait(lambda: not in_scene(case), f"{case} to be gone")


def in_scene(case: str) -> bool:
    """Returns whether the object of a case is in the planning scene or attached."""
    wanted = PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
    scene = service("get_planning_scene", GetPlanningScene)(PlanningSceneComponents(components=wanted)).scene
    found = [*scene.world.collision_objects, *(item.object for item in scene.robot_state.attached_collision_objects)]
    return any(item.id.startswith(f"{case}_1") for item in found)


def spoil_first_grasps() -> None:
    """Puts two bad grasps before the generated grasps."""
    get, add = service("get_grasp", GetStandardisedGrasp), service("add_grasp", AddStandardisedGrasp)
    grasps = []
    while (answer := get("")).success:
        grasps.append(answer.grasp_message)
    touching, heavy = copy.deepcopy(grasps[0]), copy.deepcopy(grasps[0])
    for stage in (touching.pregrasp, touching.grasp, touching.postgrasp):
        stage.pose.pose.position.z -= TOO_DEEP_M
    touching.pregrasp.posture.position = [TOUCHING_POSITION]
    heavy.postgrasp.pose.pose.position.z = heavy.grasp.pose.pose.position.z - INTO_THE_TABLE_M
    for grasp in (heavy, touching, *grasps):
        add(grasp, "")


def main() -> int:
    """Picks all objects; returns the exit code."""
    end = time.monotonic() + WAIT_S
    while not rosgraph.is_master_online() and time.monotonic() < end:
        time.sleep(0.1)
    rospy.init_node("pick_objects", disable_signals=True)
    picker = Picker(sys.argv[1])
    for number, case in enumerate(sys.argv[2:] or [*OBJECTS, SECOND_TRY]):
        model = "can" if case == SECOND_TRY else case
        print(json.dumps(picker.pick(case, model, task_runs=number == 0)), flush=True)
        picker.clear(case)
    rospy.signal_shutdown("all objects were picked")
    return 0


if __name__ == "__main__":
    sys.exit(main())
