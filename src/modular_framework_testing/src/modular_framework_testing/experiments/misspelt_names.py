# SPDX-License-Identifier: BSD-3-Clause
"""Misspelt names and impossible values in every part of an experiment, a task and a launch, with their refusals."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import roslaunch.core
import roslaunch.rlutil
import rospkg
import yaml

from modular_framework_benchmark.commands.mode_runners import known_metrics, setting_checks
from modular_framework_benchmark.experiments.experiment_file import read_experiment
from modular_framework_benchmark.experiments.reading import ExperimentFault
from modular_framework_benchmark.experiments.ros_resource_lookup import RosResourceLookup
from modular_framework_benchmark.launch_checks.ros_controller_names import controller_faults
from modular_framework_benchmark.launch_checks.ros_launch_check import launch_faults
from modular_framework_core.launching.launch_arguments import check_arguments
from modular_framework_core.launching.ros_installed_planners import installed_planners
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview
from modular_framework_core.task_constructor import pipeline

TASK: dict[str, Any] = {
    "experiment": "picks",
    "mode": "task",
    "task": "simulation_pick.yaml",
    "arguments": {"world_file": "ur5_table.world"},
    "parameters": {"/planner_name": "$planner"},
    "objects": [{"model": "cube", "x": [-0.25, 0.25], "y": [0.36, 0.64], "rests_at": 0.84}],
    "success": {"lifted": 0.10, "hold_time": 2.0},
    "factors": {"planner": ["RRTConnect", "BKPIECE"]},
    "compare": "planner",
    "metrics": ["success", "task_time"],
    "trials": 5,
}
PLAIN = TASK | {
    "parameters": {},
    "factors": {"world": {"a": {}, "b": {"arguments": {"weld_grasps": True}}}},
    "compare": "world",
}
PROBLEMS = "problems"
PLANNING: dict[str, Any] = {
    "experiment": "plans",
    "mode": "planning",
    "robot": "panda_hand_moveit_config",
    "problems": PROBLEMS,
    "group": "panda_arm",
    "planner": "$planner",
    "factors": {"planner": ["RRTConnect", "RRT"]},
    "compare": "planner",
    "trials": 2,
}
ARM = [f"panda_joint{number}" for number in range(1, 8)]
PROBLEM_SCENE: dict[str, Any] = {
    "world": {
        "collision_objects": [
            {
                "id": "box",
                "header": {"frame_id": "panda_link0"},
                "primitives": [{"type": "box", "dimensions": [0.1, 0.1, 0.1]}],
                "primitive_poses": [{"position": [0.0, 0.8, 0.5], "orientation": [0.0, 0.0, 0.0, 1.0]}],
            }
        ]
    }
}
PROBLEM_REQUEST: dict[str, Any] = {
    "group_name": "panda_arm",
    "start_state": {"joint_state": {"name": ARM, "position": [0.0, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7]}},
    "goal_constraints": [{"joint_constraints": [{"joint_name": name, "position": -0.1} for name in ARM]}],
}
KINEMATICS: dict[str, Any] = {
    "experiment": "solvers",
    "mode": "kinematics",
    "robot": "panda_hand_moveit_config",
    "group": "$group",
    "factors": {"group": ["panda_arm", "panda_manipulator"]},
    "compare": "group",
    "trials": 2,
}
GRASPS: dict[str, Any] = {
    "experiment": "grasps",
    "mode": "grasps",
    "robot": "panda_hand_moveit_config",
    "group": "panda_manipulator",
    "gripper_joint": "panda_finger_joint1",
    "method": "$method",
    "objects": [{"model": "cube", "x": 0.4, "y": 0.0, "rests_at": 0.0}],
    "factors": {
        "method": [
            "top_down_grasps.ros_top_down_node:TopDownMethod",
            "antipodal_grasps.ros_antipodal_node:AntipodalMethod",
        ],
    },
    "compare": "method",
    "trials": 2,
}
PIPELINE = "/move_group/planning_pipelines/ompl"
GENERATOR = "/top_down_grasp_generator"


@dataclass(frozen=True)
class Case:
    """A wrong name or value.

    Attributes:
        place: File or mode with the name.
        wrong: Name or value.
        refusal_text: Returns the text of the refusal, given a folder for files; "" without a refusal.
        words: Pattern of the refusal: the most similar name, or the allowed values.
    """

    place: str
    wrong: str
    refusal_text: Callable[[Path], str]
    words: str

    def is_refused(self, folder: Path) -> bool:
        """Returns whether the refusal contains the pattern."""
        return re.search(self.words, self.refusal_text(folder), re.DOTALL) is not None


@cache
def checks() -> Any:
    """Returns the checks of the settings of each mode; the loaded robots are cached."""
    return setting_checks()


def experiment_faults(content: dict[str, Any], folder: Path) -> str:
    """Returns the faults of an experiment; "" without a fault."""
    try:
        read_experiment(
            yaml.safe_dump(content), folder / "experiment.yaml", RosResourceLookup(), known_metrics(), checks()
        )
    except ExperimentFault as error:
        return str(error)
    return ""  # fmt: skip


def changed_experiment(base: dict[str, Any], path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    """Returns a copy of an experiment with a changed value.

    Args:
        base: Experiment.
        path: Keys and indices that lead to the value.
        value: New value.
    """
    content: dict[str, Any] = yaml.safe_load(yaml.safe_dump(base))
    inner: Any = content
    for key in path[:-1]:
        inner = inner.setdefault(key, {}) if isinstance(inner, dict) else inner[key]
    inner[path[-1]] = value
    return content


def in_experiment(base: dict[str, Any], path: tuple[Any, ...], value: Any, words: str) -> Case:
    """Returns the case of a value in an experiment.

    Args:
        base: Correct experiment.
        path: Keys and indices that lead to the value.
        value: Wrong value.
        words: Pattern of the refusal.
    """
    return Case(
        f"{base['mode']}: {'.'.join(map(str, path))}",
        str(value),
        lambda folder: experiment_faults(changed_experiment(base, path, value), folder),
        words,
    )


def in_parameters(name: str, value: Any, words: str) -> Case:
    """Returns the case of a ROS parameter in an experiment of mode task.

    Args:
        name: Name of the parameter.
        value: Value of the parameter.
        words: Pattern of the refusal.
    """
    return in_experiment(TASK, ("parameters", name), value, words)


def in_launch(argument: str, words: str, package: str = "modular_framework_api") -> Case:
    """Returns the case of an argument of run_framework.

    Args:
        argument: `name:=value`.
        words: Pattern of the refusal.
        package: Package of the robot.
    """

    def refusal_text(folder: Path) -> str:
        return _launch_refusal([argument], package)

    return Case("run_framework", argument, refusal_text, words)


def _launch_refusal(arguments: list[str], package: str = "modular_framework_api") -> str:
    """Returns the faults of launch arguments of run_framework; "" without a fault."""
    path = roslaunch.rlutil.resolve_launch_arguments([package, "start_framework.launch"])[0]
    try:
        check_arguments(path, arguments)
        return "\n".join(launch_faults(path, arguments))
    except roslaunch.core.RLException as error:
        return str(error)


def _copy_configuration(folder: Path) -> None:
    """Copies the shipped configuration files to a folder."""
    shipped = Path(rospkg.RosPack().get_path("modular_framework_api")) / "config"
    for path in shipped.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())


def in_config(file: str, key: str, value: Any, words: str) -> Case:
    """Returns the case of a value in a configuration file.

    Args:
        file: Name of the file.
        key: Keys that lead to the value, separated by slashes.
        value: Wrong value.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        _copy_configuration(folder)
        content = yaml.safe_load((folder / file).read_text())
        (folder / file).write_text(yaml.safe_dump(changed_experiment(content, tuple(key.split("/")), value)))
        return _launch_refusal([f"config_directory:={folder}"])

    return Case(file, f"{key}: {value}", refusal_text, words)


def _replace_first(text: str, old: str, new: str) -> str:
    """Returns a text with its first occurrence of `old` replaced, which must exist."""
    assert old in text, old
    return text.replace(old, new, 1)


def in_hardware(old: str, new: str, words: str) -> Case:
    """Returns the case of a text in the file of the hardware of the real robot.

    Args:
        old: Correct text.
        new: Wrong text.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        _copy_configuration(folder)
        text = (folder / "connection_hardware.yaml").read_text()
        (folder / "connection_hardware.yaml").write_text(_replace_first(text, old, new))
        arguments = [f"config_directory:={folder}", "simulation:=false", "task_constructor_script:=pick_and_hold.yaml"]
        return _launch_refusal(arguments)

    return Case("connection_hardware.yaml", new, refusal_text, words)


def in_controllers(old: str, new: str, words: str) -> Case:
    """Returns the case of a text in a controller file of a robot's package.

    Args:
        old: Correct text.
        new: Wrong text.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        package = Path(rospkg.RosPack().get_path("ur5_ezgripper_robot"))
        text = (package / "controllers" / "ur5_ezgripper_controller_simulation.yaml").read_text()
        (folder / "controllers").mkdir()
        (folder / "controllers" / "mine.yaml").write_text(_replace_first(text, old, new))
        (folder / "package.xml").write_text("<package><name>my_robot</name></package>")
        spawner = LaunchedNode("modular_framework_core", "robot_controllers_spawner", "/s", "/", "my_robot mine.yaml")
        joints = (*yaml.safe_load(text)["arm_trajectory_controller"]["joints"], "ezgripper_knuckle_palm_L1_1")
        before = os.environ["ROS_PACKAGE_PATH"]
        os.environ["ROS_PACKAGE_PATH"] = f"{folder}:{before}"
        try:
            return "\n".join(fault.text for fault in controller_faults(LaunchPreview((spawner,), {}), joints))
        finally:
            os.environ["ROS_PACKAGE_PATH"] = before

    return Case("controller file", new, refusal_text, words)


def in_task(old: str, new: str, words: str, parameters: dict[str, Any] | None = None) -> Case:
    """Returns the case of a text in the task that an experiment names.

    Args:
        old: Correct text.
        new: Wrong text.
        words: Pattern of the refusal.
        parameters: ROS parameters of the experiment besides those of TASK.
    """

    def refusal_text(folder: Path) -> str:
        path = Path(rospkg.RosPack().get_path("modular_framework_api")) / "task_constructor_scripts"
        text = (path / "pick_and_hold.yaml").read_text()
        (folder / "task.yaml").write_text(_replace_first(text, old, new))
        own = {**TASK["parameters"], **(parameters or {})}
        return experiment_faults({**TASK, "task": "task.yaml", "parameters": own}, folder)

    return Case("task of an experiment", new, refusal_text, words)


def in_placing_task(task: str, old: str, new: str, words: str) -> Case:
    """Returns the case of a wrong text in a shipped task that places objects; the experiment has two blocks.

    Args:
        task: Name of the shipped task.
        old: Correct text.
        new: Wrong text.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        scripts = Path(rospkg.RosPack().get_path("modular_framework_api")) / "task_constructor_scripts"
        (folder / "machines").symlink_to(scripts / "machines")
        (folder / "task.yaml").write_text(_replace_first((scripts / task).read_text(), old, new))
        block = {**TASK["objects"][0], "name": "block", "count": 2, "spacing": 0.2}
        regions = {"goal": {"x": [0.1, 0.2], "y": [0.4, 0.5]}}
        success = {"stacked": {}}
        placing = {"task": "task.yaml", "objects": [block], "regions": regions, "success": success}
        return experiment_faults({**PLAIN, **placing}, folder)

    return Case(f"{task} of an experiment", new, refusal_text, words)


def in_script(text: str, words: str, state: str = "") -> Case:
    """Returns the case of a task that `state_machine_generator --check` reads, with a state of the user's own.

    Args:
        text: Task.
        words: Pattern of the refusal.
        state: Module of the state; "" for none.
    """

    def refusal_text(folder: Path) -> str:
        (folder / "own.yaml").write_text(text)
        (folder / "states").mkdir()
        if state:
            (folder / "states" / "mine.py").write_text(state)
        printed = io.StringIO()
        with contextlib.redirect_stderr(printed):
            code = pipeline.main([str(folder / "own.yaml"), str(folder / "states"), "--check"], installed_planners)
        return printed.getvalue() if code else ""

    return Case("task script", text.split("\n")[0][:40], refusal_text, words)


def in_drawer(success: dict[str, Any], words: str) -> Case:
    """Returns the case of wrong success criteria; the experiment has a drawer with the joint `slide`.

    Args:
        success: Wrong success criteria.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        (folder / "drawer").mkdir()
        (folder / "drawer" / "model.sdf").write_text(DRAWER)
        drawer = {"model": "drawer/model.sdf", "name": "drawer", "x": 0.5, "y": 0.5, "z": 0.9}
        return experiment_faults({**TASK, "objects": [*TASK["objects"], drawer], "success": success}, folder)

    return Case("task: success", str(success), refusal_text, words)


def in_problem(kind: str, path: tuple[Any, ...], value: Any, words: str) -> Case:
    """Returns the case of a wrong value in a planning problem.

    Args:
        kind: File of the problem: `scene` or `request`.
        path: Keys and indices that lead to the value.
        value: Wrong value.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        file = folder / PROBLEMS / f"{kind}0001.yaml"
        file.write_text(yaml.safe_dump(changed_experiment(yaml.safe_load(file.read_text()), path, value)))
        return experiment_faults({**PLANNING, "group": ""} if path == ("group_name",) else PLANNING, folder)

    return Case(f"{kind} of a problem", f"{'/'.join(map(str, path))}: {value}", refusal_text, words)


def in_world(old: str, new: str, words: str) -> Case:
    """Returns the case of a wrong text in the world of an experiment.

    Args:
        old: Correct text.
        new: Wrong text.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        worlds = Path(rospkg.RosPack().get_path("modular_framework_description")) / "worlds"
        (folder / "mine.world").write_text(_replace_first((worlds / "ur5_table.world").read_text(), old, new))
        name = os.path.relpath(folder / "mine.world", worlds)
        return experiment_faults(changed_experiment(TASK, ("arguments", "world_file"), name), folder)

    return Case("world of an experiment", new, refusal_text, words)


def in_robot(new: str, words: str) -> Case:
    """Returns the case of a wrong element in the robot description that run_framework starts.

    Args:
        new: Wrong element at the end of the description.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        urdf = Path(rospkg.RosPack().get_path("ur5_ezgripper_robot")) / "urdf"
        text = (urdf / "ur5_with_ezgripper.urdf.xacro").read_text()
        (folder / "mine.urdf.xacro").write_text(_replace_first(text, "</robot>", f"{new}</robot>"))
        name = os.path.relpath(folder / "mine.urdf.xacro", urdf)
        return in_launch(f"robot_urdf_file:={name}", "").refusal_text(folder)

    return Case("robot description", new, refusal_text, words)


def in_levels(base: dict[str, Any], first: dict[str, Any], second: dict[str, Any], words: str) -> Case:
    """Returns the case of an experiment whose two levels run the same.

    Args:
        base: Correct experiment.
        first: Settings of the first level.
        second: Settings of the second level.
        words: Pattern of the refusal, which begins with the reason.
    """
    content = {**base, "factors": {"level": {"first": first, "second": second}}, "compare": "level"}
    likeness = f"levels 'first' and 'second' of factor 'level' run the same: .*{words}"
    return Case(
        f"{base['mode']}: levels", f"{first} and {second}", lambda folder: experiment_faults(content, folder), likeness
    )


def in_copied_tasks(words: str) -> Case:
    """Returns the case of two levels whose tasks are copies of a file.

    Args:
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        script = (
            Path(rospkg.RosPack().get_path("modular_framework_api")) / "task_constructor_scripts/pick_and_hold.yaml"
        )
        for name in ("first", "second"):
            (folder / f"{name}.yaml").write_text(script.read_text())
        return in_levels(PLAIN, {"task": "first.yaml"}, {"task": "second.yaml"}, "").refusal_text(folder)

    return Case("task: levels", "a copy of the task", refusal_text, words)


def in_model(old: str, new: str, words: str) -> Case:
    """Returns the case of a wrong text in the model of an object of an experiment.

    Args:
        old: Correct text.
        new: Wrong text.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        (folder / "drawer").mkdir()
        (folder / "drawer" / "model.sdf").write_text(_replace_first(DRAWER, old, new))
        drawer = {"model": "drawer/model.sdf", "name": "drawer", "x": 0.5, "y": 0.5, "z": 0.9}
        return experiment_faults({**TASK, "objects": [*TASK["objects"], drawer]}, folder)

    return Case("model of an object", new, refusal_text, words)


def in_launched_task(text: str, words: str) -> Case:
    """Returns the case of a task that run_framework starts without an experiment.

    Args:
        text: Task.
        words: Pattern of the refusal.
    """

    def refusal_text(folder: Path) -> str:
        (folder / "own.yaml").write_text(text)
        return _launch_refusal([f"task_constructor_script:={folder / 'own.yaml'}"])

    return Case("task of run_framework", text.rpartition("{source")[2].split("\n")[0], refusal_text, words)


DRAWER = """<sdf version="1.6"><model name="drawer">
<link name="cabinet"><inertial><mass>5</mass></inertial>
<collision name="c"><geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision></link>
<link name="tray"><inertial><mass>1</mass></inertial>
<collision name="c"><geometry><box><size>0.05 0.05 0.05</size></box></geometry>
<surface><friction><ode><mu>0.6</mu></ode></friction></surface></collision></link>
<joint name="slide" type="prismatic"><parent>cabinet</parent><child>tray</child>
<axis><xyz>1 0 0</xyz><limit><lower>0</lower><upper>0.2</upper></limit></axis></joint>
</model></sdf>
"""
IK = "/robot_description_kinematics"
LIMITS = "/robot_description_planning/joint_limits"
OWN_STATE = """import smach
class Mine(smach.State):
    def __init__(self, outcomes=("success",), **options):
        super().__init__(outcomes=list(outcomes))
"""
OWN_TASK = """name: {name}
source: state_machine
outcomes: [success]
node_name: own
states:
  - FIRST: {{source: mine, {option}outcomes: [success], transitions: {{success: success}}}}
"""

FIRST_STATE = "  - GenerateGrasps:"
SET_PLANNER = """  - Choose:
      {{source: set_planner, planner_id: {}, transitions: {{success: GenerateGrasps, fail: quit_pipeline}}}}
"""
PLANNER_TASK = """name: own
source: framework_state_machine
outcomes: [done, gave_up]
states:
  - A: {{source: set_planner, planner_id: {}, transitions: {{success: done, fail: gave_up}}}}
"""
OBJECT_TASK = """name: own
source: framework_state_machine
outcomes: [done, gave_up]
states:
  - A: {{source: {}, transitions: {{success: done, fail: gave_up}}}}
"""
STATE_TASK = """name: own
source: framework_state_machine
outcomes: [done, gave_up]
states:
  - A: {source: plan, target_state_type: joint_state, target_state_name: stability_pos, plan_name: p,
        transitions: {success: done, fail: gave_up}}
"""

CASES = [
    # ROS parameters of an experiment
    in_parameters("/planer_name", "RRT", "did you mean '/planner_name'"),
    in_parameters("/planner_name", "BKPIECEE", "no planner 'BKPIECEE'.*did you mean 'BKPIECE'"),
    in_parameters("/planner_name", "omple/RRT", "no pipeline 'omple'.*did you mean 'ompl'"),
    in_parameters("/planner_name", "pilz_industrial_motion_planner/LINE", "no planner.*LIN'"),
    in_parameters("/planner_name", 3, "is 3; allowed: a text"),
    in_parameters(f"{IK}/arm/kinematics_solver", "numerik", "no kinematics_solver 'numerik'.*did you mean 'numeric'"),
    in_parameters(f"{IK}/arm/kinematics_solver_timout", 0.1, "no key.*did you mean 'kinematics_solver_timeout'"),
    in_parameters(f"{IK}/arm/kinematcs_solver", "numeric", "no key of kinematics.*did you mean 'kinematics_solver'"),
    in_parameters(f"{IK}/arm/kinematic_solver_attempts", 3, "did you mean 'kinematics_solver_attempts'"),
    in_parameters(f"{IK}/arm/position_only", True, "did you mean 'position_only_ik'"),
    in_parameters(f"{IK}/armm/kinematics_solver", "numeric", "no planning group 'armm'.*did you mean 'arm'"),
    in_parameters("/robot_speed_factor", 7, "is 7; allowed: a number, above 0 and at most 1"),
    in_parameters("/robot_speed_factor", "fast", "is 'fast'; allowed: a number"),
    in_parameters("/arm_group_name", "armm", "no planning group 'armm'.*did you mean 'arm'"),
    in_parameters("/number_plan_attempt", 0, "is 0; allowed: a whole number, at least 1"),
    in_parameters("/number_plan_attempt", 1.5, "is 1.5; allowed: a whole number"),
    in_parameters("/planning_max_time", -1.0, "is -1.0; allowed: a number, above 0"),
    in_parameters("/max_torque", "strong", "is 'strong'; allowed: a number"),
    in_parameters("/manipulator_group_name", "ezgriper", "no planning group 'ezgriper'.*did you mean 'ezgripper'"),
    in_parameters("/seed", 5, "each episode has its own seed"),
    in_parameters("/task/wait_for_start", False, "an episode starts its task itself"),
    in_parameters(f"{GENERATOR}/yaw_step", -3, "is -3; allowed: a number, at least 0.02"),
    in_parameters(f"{GENERATOR}/yaw_stp", 0.3, f"did you mean '{GENERATOR}/yaw_step'"),
    in_parameters(f"{GENERATOR}/finger_clearance", "wide", "is 'wide'; allowed: a number"),
    in_parameters(f"{GENERATOR}/max_grasps", 0, "is 0; allowed: a whole number, at least 1"),
    in_parameters(f"{GENERATOR}/check_reachability", "yes please", "allowed: true or false"),
    in_parameters(
        f"{GENERATOR}/gripper_joint", "ezgripper_knuckle_palm_L1", "no joint.*did you mean 'ezgripper_knuckle"
    ),
    in_parameters(GENERATOR, {"max_checks": -4}, "is -4; allowed: a whole number, at least 1"),
    in_parameters("/antipodal_grasp_generator/max_grasps", 3, "no node of the launch reads"),
    in_parameters("/gazebo/physics_engine", "bullet", "is 'bullet'; allowed: pybullet, mujoco"),
    in_parameters("/gazebo/time_step", 0.05, "is 0.05; allowed: a number, at least 0.0001 and at most 0.01"),
    in_parameters("/gazebo/weld_grasp", True, "did you mean '/gazebo/weld_grasps'"),
    in_parameters(
        f"{PIPELINE}/planner_configs/RRTConnect/range", -1, "'range' is '-1'.*must be a number of at least 0"
    ),
    in_parameters(f"{PIPELINE}/planner_configs/RRTConnect/rnge", 1.0, "no setting 'rnge'.*did you mean 'range'"),
    in_parameters(f"{PIPELINE}/planner_configs/RRTConect/range", 1.0, "no planner 'RRTConect'.*'RRTConnect'"),
    in_parameters(f"{PIPELINE}/planner_configs/RRT/goal_bias", 2.0, "'goal_bias' is '2.0'.*from 0 to 1"),
    in_parameters(
        f"{PIPELINE}/plannr_configs/RRTConnect/range", 1.0, "no parameter 'plannr_configs'.*'planner_configs'"
    ),
    in_parameters("/move_group/planning_pipelines/omple/planner_configs/RRT/range", 1.0, "no pipeline 'omple'.*'ompl'"),
    in_parameters("/move_group/longest_valid_segment_fraction", 0.1, "no node of the launch reads"),
    in_parameters("/move_group/default_planning_pipeline", "omple", "no pipeline 'omple'.*did you mean 'ompl'"),
    in_parameters(f"{PIPELINE}/request_adapters", "AddTimeOptimal", "did you mean '.*/AddTimeOptimalParam"),
    in_parameters(f"{PIPELINE}/planning_plugin", "ompl_interface/OMPL", "did you mean 'ompl_interface/OMPLPlanner'"),
    in_parameters(f"{PIPELINE}/jiggle_fraction", 3, "is 3; allowed: a number, at least 0 and at most 1"),
    in_parameters(f"{PIPELINE}/path_tolerance", -1, "is -1; allowed: a number, at least 0"),
    in_parameters(f"{PIPELINE}/resample_dt", 0, "is 0; allowed: a number, at least 0.004"),
    in_parameters("/move_group/trajectory_execution/allowed_start_tolerance", -1, "allowed: a number, at least 0"),
    in_parameters(f"{LIMITS}/elbo_joint/max_velocity", 1.0, "names no joint: 'elbo_joint'.*did you mean 'elbow_joint'"),
    in_parameters(f"{LIMITS}/elbow_joint/max_velocty", 1.0, "did you mean 'max_velocity'"),
    in_parameters(f"{LIMITS}/elbow_joint", {"max_velocity": -1}, "is -1; allowed: a number, above 0"),
    in_parameters(f"{LIMITS}/elbow_joint", 3, "is 3; allowed: has_position_limits"),
    in_parameters("/joint_limits/elbo_joint/max_velocity", 1.0, "did you mean 'elbow_joint'"),
    in_parameters(
        "/robot_description_planning/default_velocity_scaling_facor", 0.5, "mean 'default_velocity_scaling_factor'"
    ),
    in_parameters(
        "/robot_description_planning/default_robot_link_padding/base_lnk", 0.1, "no link.*did you mean 'base_link'"
    ),
    in_parameters(
        "/move_group/trajectory_execution/joints_allowed_start_tolerance/elbo_joint", 0.1, "did you mean 'elbow_joint'"
    ),
    in_parameters(f"{PIPELINE}/arm/default_planner_config", "RRTConect", "no planner.*did you mean 'RRTConnect'"),
    in_parameters(f"{PIPELINE}/default_planner_config", "RRTConect", "no planner.*did you mean 'RRTConnect'"),
    in_parameters(f"{PIPELINE}/arm/planner_configs", ["RRT", "PRMM"], "no planner 'PRMM'"),
    in_parameters(
        "/move_group/planning_pipelines/stomp/stomp_moveit/num_rolouts", 5, "names no parameter.*mean 'num_rollouts'"
    ),
    in_parameters("/collision_detector", "Bulet", "'Bulet' is not known.*did you mean 'Bullet'"),
    in_parameters("/move_group/collision_detector", "fcll", "'fcll' is not known.*did you mean 'FCL'"),
    in_parameters("/move_group/capabilities", "move_group/TfPublishr", "did you mean 'move_group/TfPublisher'"),
    in_parameters(
        "/move_group/disable_capabilities", "move_group/MoveGroupPickPlaceActon", "mean 'move_group/MoveGroupPickPlace"
    ),
    in_parameters("/move_group/planning_pipelines/ompl/capabilities", "move_group/Tf", "no capability 'move_group/Tf'"),
    in_parameters(
        "/move_group/moveit_controller_manager",
        "moveit_simple_controller_manager/MoveItSimpleControllerManagr",
        "did you mean 'moveit_simple_controller_manager/MoveItSimpleControllerManager'",
    ),
    # Launch arguments of an experiment
    in_experiment(TASK, ("arguments",), {"world_fil": "ur5_table.world"}, "did you mean 'world_file'"),
    in_experiment(TASK, ("arguments", "world_file"), "ur5_tabel.world", "did you mean 'ur5_table.world'"),
    in_experiment(TASK, ("arguments", "physics_engine"), "bullet", "allowed: pybullet, mujoco"),
    in_experiment(TASK, ("arguments", "time_step"), 0.05, "at most 0.01"),
    in_experiment(TASK, ("arguments", "simulation"), False, "allowed: true"),
    in_experiment(TASK, ("arguments", "seed"), 4, "each episode has its own seed"),
    in_experiment(TASK, ("arguments", "generated_state_machine_name"), "a/b", "is 'a/b', which must be letters"),
    in_experiment(PLAIN, ("arguments", "planner_name"), "RRTConect", "no planner 'RRTConect'.*'RRTConnect'"),
    in_experiment(
        TASK, ("arguments", "controller_file"), "ur5_controllers.yaml", "ur5_ezgripper_controller_simulation"
    ),
    in_experiment(
        TASK, ("arguments", "method_launch_file"), "top_down_grasp/top_down_grasps.launch", "top_down_grasps"
    ),
    in_experiment(TASK, ("arguments", "states_directory"), "/no/states", "no folder /no/states"),
    in_experiment(TASK, ("arguments", "templates_directory"), "/no/templates", "no folder /no/templates"),
    in_experiment(TASK, ("arguments", "state_machine_to_load"), "not_there.py", "no file not_there.py"),
    # Other keys of an experiment
    in_experiment(TASK, ("launch",), "modular_framework_api/start_framwork.launch", "did you mean 'start_framework"),
    in_experiment(TASK, ("task",), "simulation_pik.yaml", "did you mean 'simulation_pick.yaml'"),
    in_experiment(TASK, ("objects", 0, "model"), "cub", "did you mean 'cube'"),
    in_experiment(TASK, ("success", "liftd"), 0.1, "'liftd' is unknown; allowed: lifted, "),
    in_experiment(TASK, ("metrics",), ["sucess"], "did you mean 'success'"),
    in_experiment(TASK, ("mode",), "tasks", "did you mean 'task'"),
    in_experiment(TASK, ("compare",), "planer", "did you mean 'planner'"),
    in_experiment(TASK, ("trails",), 5, "'trails' is unknown; allowed: .*trials"),
    in_experiment(TASK, ("factors", "planner"), ["RRTConnect", "ompl/RRTConnect"], "run the same"),
    in_experiment(
        PLAIN,
        ("factors", "world"),
        {"a": {"parameters": {"/collision_detector": "FCL"}}, "b": {"parameters": {"/collision_detector": "Bullet"}}},
        "run the same",
    ),
    in_experiment(
        PLAIN,
        ("factors", "world"),
        {"a": {}, "b": {"parameters": {"/move_group/plan_execution/max_replan_attempts": 5}}},
        "run the same",
    ),
    in_experiment(
        PLAIN,
        ("factors", "world"),
        {"a": {"arguments": {"weld_grasps": False}}, "b": {"arguments": {"weld_grasps": False}}},
        "run the same: their settings are equal",
    ),
    in_levels(
        PLAIN, {}, {"parameters": {"/move_group/max_safe_path_cost": 5}}, "cost' has no effect; change or remove"
    ),
    in_levels(
        PLAIN,
        {},
        {"parameters": {f"{PIPELINE}/planner_configs/RRT/range": 0.4}},
        "RRT/range' belongs to the planner 'RRT', which the task does not use",
    ),
    in_levels(
        PLAIN,
        {"parameters": {"/move_group/planning_pipelines/stomp/stomp_moveit/num_rollouts": 5}},
        {"parameters": {"/move_group/planning_pipelines/stomp/stomp_moveit/num_rollouts": 9}},
        "belongs to the pipeline 'stomp', which the task does not use",
    ),
    in_levels(
        PLAIN,
        {},
        {"regions": {"spare": {"x": [0.1, 0.2], "y": [0.4, 0.5]}}},
        "belongs to the region 'spare', which the task does not use",
    ),
    in_levels(
        PLAIN,
        {"arguments": {"regions": "{spare: {x: [0.1, 0.2]}}"}},
        {"arguments": {"regions": "{spare: {x: [0.1, 0.3]}}"}},
        "'arguments.regions' resolves to the same in both",
    ),
    in_copied_tasks("'first' and 'second' of factor 'level' run the same: 'task' resolves to the same in both"),
    in_levels(PLAIN, {}, {"extra_parameters": ["/my_node/gain"]}, "'extra_parameters' sets no value"),
    in_levels(PLAIN, {}, {"arguments": {"viewer_port": 8081}}, "'arguments.viewer_port' resolves to the same in both"),
    in_levels(PLAIN, {}, {"arguments": {"generated_state_machine_name": "mine"}}, "resolves to the same in both"),
    # The task that an experiment names
    in_task("source: plan", "source: plann", "did you mean 'plan'"),
    in_task("target_state_type: joint_state", "target_state_type: joint_stat", "joint_state"),
    in_task("plan_name:", "plan_nam:", "did you mean 'plan_name'"),
    in_task("hold_pose: stability_pose", "hold_pose: stability_pos", "'stability_pos' is unknown.*'stability_pose'"),
    in_task(FIRST_STATE, f"{SET_PLANNER.format('BKPIECEE')}{FIRST_STATE}", "'BKPIECEE' is unknown.*'BKPIECE'"),
    in_task(FIRST_STATE, f"{SET_PLANNER.format('pilz/LIN')}{FIRST_STATE}", "planner 'pilz/LIN' is unknown.*allowed"),
    in_task(
        FIRST_STATE,
        f"{SET_PLANNER.format('RRT')}{FIRST_STATE}",
        "planner 'RRT', which the task names: .*'goal_bias' is '2.0'",
        {f"{PIPELINE}/planner_configs/RRT/goal_bias": 2.0},
    ),
    in_task(
        FIRST_STATE,
        """  - Spawn:
      {source: spawn_object, object_type: cubee, transitions: {success: GenerateGrasps, fail: quit_pipeline}}
"""
        + FIRST_STATE,
        "object type 'cubee' is unknown; allowed: .*did you mean 'cube'",
    ),
    in_task(
        FIRST_STATE,
        """  - Spawn:
      {source: spawn_object, object_type: cube, object_name: ur5_with_ezgripper,
       transitions: {success: GenerateGrasps, fail: quit_pipeline}}
"""
        + FIRST_STATE,
        "the object 'ur5_with_ezgripper' has the name of the robot",
    ),
    # Other modes
    in_experiment(PLANNING, ("factors", "planner"), ["RRTConnect", "RTT"], "no planner 'RTT'.*did you mean 'RRT'"),
    in_experiment(PLANNING, ("pipeline",), "omple", "no pipeline 'omple'.*did you mean 'ompl'"),
    in_experiment(
        PLANNING, ("group",), "pandaarm", "planning group 'pandaarm' does not exist.*did you mean 'panda_arm'"
    ),
    in_experiment(PLANNING, ("robot",), "panda_hand_moveit_confg", "did you mean 'panda_hand_moveit_config'"),
    in_experiment(PLANNING, ("planner_parameters",), {"rang": 1.0}, "no setting 'rang'.*did you mean 'range'"),
    in_experiment(PLANNING, ("planner_parameters",), {"range": "far"}, "'range' is 'far'.*a number of at least 0"),
    in_experiment(PLANNING, ("parameters",), {f"{PIPELINE}/plannr_configs/RRT/range": 1.0}, "'planner_configs'"),
    in_experiment(
        PLANNING,
        ("parameters",),
        {f"{PIPELINE}/request_adapters": "AddTimeOptimal"},
        "did you mean '.*/AddTimeOptimalParam",
    ),
    in_experiment(PLANNING, ("parameters",), {f"{PIPELINE}/search_thread": 2}, "did you mean 'search_threads'"),
    in_experiment(
        PLANNING,
        ("parameters",),
        {"/robot_description_planning/joint_limits/panda_joint1/max_velocity": 1.0},
        "no effect in this mode; allowed: names below /move_group/planning_pipelines/ompl/",
    ),
    in_experiment(PLANNING, ("parameters",), {"/move_group/seed": 4}, "each episode has its own seed"),
    in_experiment(
        PLANNING, ("parameters",), {"/move_group/planning_pipelines/stomp": {"jiggle_fraction": 0.1}}, "no effect"
    ),
    in_experiment(KINEMATICS, ("parameters",), {"/planer_name": "RRT"}, "no effect in this mode"),
    in_experiment(KINEMATICS, ("factors", "group"), ["panda_arm", "panda_amr"], "panda_arm"),
    in_experiment(KINEMATICS, ("solver",), "trac_ikk", "allowed: closed form, numeric"),
    in_experiment(KINEMATICS, ("solver",), "kdl_kinematics_plugin/KDLKinematicsPlugin", "allowed: closed form"),
    in_experiment(GRASPS, ("gripper_joint",), "panda_finger_joint", "panda_finger_joint1"),
    in_experiment(GRASPS, ("method_parameters",), {"finger_clearance": "wide"}, "is 'wide'; allowed: a number"),
    in_experiment(GRASPS, ("method_parameters",), {"finger_clearence": 0.01}, "did you mean 'finger_clearance'"),
    in_experiment(GRASPS, ("method_parameters",), {"max_grasps": 3}, "'max_grasps' has no effect in this mode"),
    in_levels(
        {**GRASPS, "method": GRASPS["factors"]["method"][0]},
        {},
        {"method_parameters": {"finger_clearance": 0.012}},
        "'method_parameters.finger_clearance' resolves to the same in both",
    ),
    in_levels(
        {**PLANNING, "planner": "RRTConnect"},
        {},
        {"parameters": {f"{PIPELINE}/planner_configs/RRT/range": 0.4}},
        "belongs to the planner 'RRT', which does not run",
    ),
    in_levels(
        {**PLANNING, "planner": "RRTConnect"},
        {"planner_parameters": {"range": 0.4}},
        {"parameters": {f"{PIPELINE}/planner_configs/RRTConnect/range": 0.4}},
        "'planner_parameters.range' resolves to the same in both",
    ),
    in_levels({**PLANNING, "planner": "RRT"}, {"pipeline": "ompl"}, {}, "'pipeline' resolves to the same in both"),
    in_experiment({**PLANNING, "planner": ""}, ("planner_parameters",), {"range": 0.4}, "no effect without a planner"),
    in_experiment(GRASPS, ("factors", "method"), ["top_down_grasps.ros_top_down_node:TopDown", "b:C"], "MODULE:CLASS"),
    # run_framework and configuration files
    in_launch("planner_name:=BKPIECEE", "no planner 'BKPIECEE'.*did you mean 'BKPIECE'"),
    in_launch("physics_engine:=mujoko", "is 'mujoko'; allowed: pybullet, mujoco"),
    in_launch("controller_file:=no.yaml", "ur5_ezgripper_controller_simulation.yaml"),
    in_launch("generated_state_machine_name:=rospy", "is 'rospy', which is the Python module"),
    in_launch("seed:=-4", "is -4; allowed: a whole number, at least 0"),
    in_launch("task_constructor_script:=simulation_pik.yaml", "simulation_pik.yaml"),
    in_launch("viewer_port:=-3", "'viewer_port' is -3; allowed: a whole number, at least 0 and at most 65535"),
    in_launch("viewer_port:=70000", "'viewer_port' is 70000; allowed: .*at most 65535"),
    in_launch("viewer_port:=eight", "'viewer_port' is 'eight'; allowed: a whole number"),
    in_launch("ui_port:=0", "'ui_port' is 0; allowed: a whole number, at least 1"),
    in_experiment(PLAIN, ("arguments", "viewer_port"), -3, "'viewer_port' is -3; allowed: a whole number"),
    in_launch("planner_name:=RRTConect", "did you mean 'RRTConnect'", "panda_hand_robot"),
    in_launch("regions:={goal: {x: 3}}", "region 'goal' is {'x': 3}; allowed: spans"),
    in_launch("regions:={goal: {x: [0.2, 0.1]}}", "region 'goal' is .*allowed: spans"),
    in_launch("regions:=5", "'regions': the value is 5; allowed: spans"),
    in_launch("simulation_starting_pose:=-J elbo_joint 1.0", "did you mean 'elbow_joint'"),
    in_launch("simulation_starting_pose:=abc", "'simulation_starting_pose': .*abc"),
    in_launch("manipulator_prefix:=ezgriper", "'ezgriper', but no link name contains it; the links are: .*ezgripper"),
    in_config("motion_planner_config.yaml", "planner_name", "BKPIECEE", "did you mean 'BKPIECE'"),
    in_config(
        "generative_methods_config.yaml", "top_down_grasp_generatr", {"yaw_step": 0.1}, "'/top_down_grasp_generator/yaw"
    ),
    in_config("sensors_config.yaml", "fixed_kinect", {"frame_id": "a", "frame_rol": 0.0}, "frame_roll"),
    in_config("sensors_config.yaml", "fixed_kinect/frame_x", "left", "left.*number"),
    in_config("named_poses.yaml", "mine", {"reference_frame": "world", "positon": {"x": 1}}, "positon"),
    in_config("named_joint_states.yaml", "mine", {"elbow_joint": "high"}, "high.*number"),
    in_config(
        "named_trajectories.yaml",
        "mine",
        [{"name": "stability_pose", "interpolate_tme": 1.0}],
        r"interpolate_tme.*interpolate_time",
    ),
    in_config(
        "manipulator_controller_parameters.yaml",
        "manipulator_controller_action_server_type",
        "moveit_grasp_action_servr",
        "has no program 'moveit_grasp_action_servr'.*did you mean 'moveit_grasp_action_server'",
    ),
    in_config("motion_planner_config.yaml", "robot_speed_factor", 1.5, "is 1.5; allowed: a number, above 0"),
    in_config(
        "motion_planner_config.yaml", "arm_group_name", "arm_and_manipulatr", "did you mean 'arm_and_manipulator'"
    ),
    in_config("motion_planner_config.yaml", "planner_nme", "PRM", "did you mean '/planner_name'"),
    in_config("generative_methods_config.yaml", "top_down_grasp_generator/yaw_stp", 0.2, "did you mean.*yaw_step'"),
    in_config("generative_methods_config.yaml", "top_down_grasp_generator/max_checks", "all", "is 'all'; allowed"),
    in_config(
        "named_joint_states.yaml",
        "stability_pose/elbo_joint",
        1.0,
        "no joint: 'elbo_joint'.*did you mean 'elbow_joint'",
    ),
    in_config("named_joint_states.yaml", "mine", {"elbo_joint": 1.0}, "'mine' names no joint: 'elbo_joint'"),
    in_config(
        "named_trajectories.yaml",
        "mine",
        [{"name": "stability_pos", "interpolate_time": 1.0}],
        "no joint state named 'stability_pos' is stored.*did you mean 'stability_pose'",
    ),
    # Hardware and controllers
    in_hardware("UrArmRobotHW", "UrArmRobotHw", "did you mean 'modular_framework_drivers/UrArmRobotHW'"),
    in_hardware("modular_framework_drivers/EzG", "modular_framework_driver/EzG", "framework_drivers/EzGripperRobotHW'"),
    in_hardware("[ur_robot_hw,", "[ur_robot_h,", "no parameter '/ur_robot_h/type'.*did you mean 'ur_robot_hw'"),
    in_hardware("robot_hardware: [", "robot_hardwares: [", "did you mean '/robot_hardware'"),
    in_hardware('robot_id: ""', 'robot_id: "shoulde"', "no joint name begins with 'shoulde_'.*did you mean 'shoulder'"),
    in_hardware(
        "type: modular_framework_drivers/UrArmRobotHW",
        "type: modular_framework_control/MockRobotHW\n  joints: [elbo_joint]",
        "parameter '/ur_robot_hw/joints': there is no joint 'elbo_joint'.*did you mean 'elbow_joint'",
    ),
    in_hardware(
        "type: modular_framework_drivers/UrArmRobotHW",
        "type: modular_framework_control/MockRobotHW\n  initial_positions: {elbo_joint: 1.0}",
        "'/ur_robot_hw/initial_positions/elbo_joint' names no joint: 'elbo_joint'.*did you mean 'elbow_joint'",
    ),
    in_hardware(
        "type: modular_framework_drivers/EzGripperRobotHW",
        "type: modular_framework_drivers/EzGripperRobotHW\n  joint: ezgripper_knuckle_palm_L1",
        "there is no joint 'ezgripper_knuckle_palm_L1'; .*did you mean 'ezgripper_knuckle_palm_L1_",
    ),
    in_hardware("robot_ip_address", "robot_ip_adress", "did you mean '/ur_robot_hw/robot_ip_address'"),
    in_controllers(
        "position_controllers/JointTrajectoryController",
        "position_controllers/JointTrajectoryControler",
        "did you mean 'position_controllers/JointTrajectoryController'",
    ),
    in_controllers("- elbow_joint", "- elbo_joint", "no joint 'elbo_joint'.*did you mean 'elbow_joint'"),
    in_controllers("    elbow_joint:", "    elbo_joint:", "'constraints/elbo_joint/.*: 'elbo_joint'.*'elbow_joint'"),
    in_controllers("goal_time:", "goal_tme:", "no joint or parameter: 'goal_tme'.*did you mean 'goal_time'"),
    in_controllers("stop_trajectory_duration", "stop_trajectory_duratin", "did you mean 'stop_trajectory_duration'"),
    in_controllers("state_publish_rate", "state_publish_rat", "did you mean 'state_publish_rate'"),
    in_controllers("state_publish_rate: ", "state_publish_rate: -", "'state_publish_rate' is -.*at least 0"),
    in_controllers("ezgripper_knuckle_palm_L1_1", "ezgripper_knuckle_palm_L1_", "mean 'ezgripper_knuckle_palm_L1_1'"),
    # Task scripts
    in_script(OWN_TASK.format(name="own", option="lambda: 3, "), "key 'lambda' is unknown", OWN_STATE),
    in_script(OWN_TASK.format(name="own", option="class: 3, "), "key 'class' is unknown", OWN_STATE),
    in_script(OWN_TASK.format(name="own", option="self: 3, "), "key 'self' is unknown", OWN_STATE),
    in_script(OWN_TASK.format(name="n" * 300, option=""), "has 300 characters; a file name may have 100", OWN_STATE),
    in_script(PLANNER_TASK.format("BKPIECEE"), "planner 'BKPIECEE' is unknown.*did you mean 'BKPIECE'"),
    in_script(PLANNER_TASK.format("omple/RRT"), "planner 'omple/RRT' is unknown.*did you mean 'ompl/RRT'"),
    in_script(STATE_TASK, "joint state 'stability_pos' is unknown.*did you mean 'stability_pose'"),
    in_script(OWN_TASK.format(name="rospy", option=""), "is the Python module .*choose another name", OWN_STATE),
    # Models and objects
    in_placing_task(
        "pick_and_place.yaml",
        "support: table",
        "support: tabel",
        "'support': the model 'tabel' is unknown; allowed: block_1, block_2, .*did you mean 'table'",
    ),
    in_placing_task(
        "stack.yaml", "prefix: block", "prefix: blok", "series of objects 'blok' is unknown; .*did you mean 'block'"
    ),
    in_placing_task("stack.yaml", "object_name: userdata", "object_name: blok_1", "'blok_1'.*did you mean 'block_1'"),
    in_script(
        OBJECT_TASK.format("spawn_object, object_type: cubee"), "object type 'cubee' is unknown.*did you mean 'cube'"
    ),
    in_launched_task(
        OBJECT_TASK.format("spawn_object, object_type: cann"), "object type 'cann' is unknown.*did you mean 'can'"
    ),
    in_launched_task(
        OBJECT_TASK.format("delete_object, object_name: tabel"), "model 'tabel' is unknown; .*did you mean 'table'"
    ),
    in_config(
        "generative_methods_config.yaml",
        "top_down_grasp_generator/object_name",
        "wood_blok",
        "no model or object 'wood_blok'; .*did you mean 'wood_block'",
    ),
    in_experiment(TASK, ("objects", 0, "name"), "ur5_with_ezgripper", "has the name of the robot in the simulation"),
    in_parameters(f"{GENERATOR}/object_name", "cubee", "no model or object 'cubee'; .*did you mean 'cube_1'"),
    in_experiment(TASK, ("objects", 0, "name"), "table", "the world has a model 'table' already"),
    # Planning problems
    in_problem("request", ("group_name",), "panda_amr", "no planning group 'panda_amr'.*did you mean 'panda_arm'"),
    in_problem(
        "request", ("start_state", "joint_state", "name", 1), "panda_joint22", "request0001.yaml: .*mean 'panda_joint2'"
    ),
    in_problem(
        "request",
        ("start_state", "joint_state"),
        {"name": [*ARM, "panda_finger_joint11"], "position": [0.0] * 8},
        "joint 'panda_finger_joint11' is unknown; .*did you mean 'panda_finger_joint1'",
    ),
    in_problem(
        "request",
        ("goal_constraints", 0, "joint_constraints", 1, "joint_name"),
        "panda_joint99",
        "joint 'panda_joint99' is not in group 'panda_arm'; allowed: panda_joint1, .*did you mean 'panda_joint",
    ),
    in_problem(
        "request",
        ("goal_constraints",),
        [{"joint_constraints": [], "position_constraints": [{"link_name": "panda_link8"}]}],
        "position_constraints is not supported.*has no joint_constraints",
    ),
    in_problem("request", ("goal_constraints",), [], "goal_constraints is empty"),
    in_problem(
        "request",
        ("path_constraints",),
        {"orientation_constraints": [{"link_name": "panda_link8"}]},
        "path_constraints is not supported",
    ),
    in_problem("request", ("goal_constraint",), [], "'goal_constraint' is unknown.*did you mean 'goal_constraints'"),
    in_problem(
        "request", ("start_state", "joint_state", "position", 0), "left", "position of 'panda_joint1' is 'left'"
    ),
    in_problem("scene", ("wrld",), {}, "the key 'wrld' is unknown; .*did you mean 'world'"),
    in_problem("scene", ("world", "collision_objects", 0, "header"), {"frame_id": "panda_lnk0"}, "mean 'panda_link0'"),
    in_problem("scene", ("world", "collision_objects", 0, "primitives", 0, "type"), "bxo", "primitive 'bxo'; allowed"),
    in_problem("scene", ("world", "collision_objects", 0, "meshes"), [{"vertices": []}, 1], "meshes is not supported"),
    # Predicates and worlds
    in_drawer(
        {"not": {"joint_at_least": {"model": "drawer", "joint": "slidr", "position": 0.1}}},
        "joint of model 'drawer' in joint_at_least 'slidr' is unknown; allowed: slide; did you mean 'slide'",
    ),
    in_drawer({"joint_at_least": {"model": "drawer", "joint": "slidr", "position": 0.1}}, "did you mean 'slide'"),
    in_drawer({"joint_at_least": {"model": "table", "joint": "slide", "position": 0.1}}, "joint of model 'table'"),
    in_drawer({"not": {"joint_at_least": {"model": "drawr", "joint": "slide", "position": 0.1}}}, "mean 'drawer'"),
    in_robot("<gazebo reference='base_link'><selfColide>1</selfColide></gazebo>", "did you mean 'selfCollide'"),
    in_robot(
        "<gazebo reference='base_lnk'><mu1>0.1</mu1></gazebo>", "no link or joint 'base_lnk'; did you mean 'base_"
    ),
    in_world(
        "<include>", "<inclde></inclde><include>", "mine.world:[0-9]+: <inclde>: .*<world>; did you mean 'include'"
    ),
    in_world("</world>", "<modl name='x'/></world>", "SDF defines no <modl> in <world>; did you mean 'model'"),
    in_world("<max_step_size>", "<max_stp_size>2</max_stp_size><max_step_size>", "did you mean 'max_step_size'"),
    in_model("<friction>", "<frictoin/><friction>", "model.sdf:[0-9]+: <frictoin>: .*did you mean 'friction'"),
    in_model(
        "<link name", "<pose relatve_to='tray'/><link name", "no attribute 'relatve_to'; did you mean 'relative_to'"
    ),
    in_world("model://table", "model://tabel", "mine.world:[0-9]+: .*'model://tabel'.*did you mean 'table'"),
]


def write_problem(folder: Path) -> None:
    """Writes a planning problem for experiments of mode planning."""
    (folder / PROBLEMS).mkdir(exist_ok=True)
    for kind, content in (("scene", PROBLEM_SCENE), ("request", PROBLEM_REQUEST)):
        (folder / PROBLEMS / f"{kind}0001.yaml").write_text(yaml.safe_dump(content))
