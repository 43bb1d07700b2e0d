# SPDX-License-Identifier: BSD-3-Clause
"""What is named is what runs: a name that nothing answers to is refused before anything starts.

A third of the cases; `benchmarks/named_is_run` has all of them, and gives some to the commands.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import roslaunch.rlutil
import rospkg
import yaml

from modular_framework_benchmark.commands.mode_runners import known_metrics
from modular_framework_benchmark.experiments.design import design_text, plan_episodes
from modular_framework_benchmark.experiments.experiment_file import read_experiment
from modular_framework_benchmark.experiments.ros_resource_lookup import RosResourceLookup
from modular_framework_benchmark.launch_checks.ros_launch_check import LaunchCheck
from modular_framework_core.launching.ros_launch_preview import preview_launch
from modular_framework_testing.experiments.misspelt_names import (
    CASES,
    FIRST_STATE,
    GENERATOR,
    GRASPS,
    KINEMATICS,
    OWN_STATE,
    OWN_TASK,
    PIPELINE,
    PLAIN,
    PLANNING,
    SET_PLANNER,
    TASK,
    Case,
    changed_experiment,
    checks,
    experiment_faults,
    in_config,
    in_controllers,
    in_hardware,
    in_launch,
    in_placing_task,
    in_script,
    write_problem,
)


@pytest.mark.parametrize("case", CASES[::3], ids=lambda case: f"{case.place} {case.wrong}"[:60])
def test_a_wrong_name_or_value_is_refused_with_the_nearest_or_the_allowed_one(case: Case, tmp_path: Path) -> None:
    write_problem(tmp_path)
    assert case.is_refused(tmp_path)


@pytest.mark.parametrize("content", [TASK, PLANNING, KINEMATICS, GRASPS], ids=lambda content: content["mode"])
def test_the_experiments_that_the_cases_change_are_in_order(content: dict, tmp_path: Path) -> None:
    write_problem(tmp_path)
    assert experiment_faults(content, tmp_path) == ""


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("parameters", "/planner_name"), "RRTConnectkConfigDefault"),
        (("parameters", "/planner_name"), "LIN"),
        (("parameters", "/planner_name"), "stomp/stomp"),
        (("parameters", f"{PIPELINE}/planner_configs/RRTConnect/range"), 0.4),
        (("parameters", f"{PIPELINE}/planner_configs"), {"Mine": {"type": "geometric::RRT", "range": 0.2}}),
        (("parameters", GENERATOR), {"yaw_step": 0.5}),
        (("parameters", "/robot_description_planning"), {"joint_limits": {"elbow_joint": {"max_velocity": 1.0}}}),
        (("parameters", f"{PIPELINE}/arm"), {"default_planner_config": "None", "planner_configs": ["RRT", "PRM"]}),
        (("parameters", "/move_group/planning_pipelines/stomp/stomp_moveit"), {"num_rollouts": 5}),
        (("parameters", "/move_group/capabilities"), "move_group/TfPublisher"),
        (
            ("parameters", "/move_group/moveit_controller_manager"),
            "moveit_ros_control_interface::MoveItControllerManager",
        ),
        # keys of plugins: TRAC-IK, bio_ik and opw
        (("parameters", "/robot_description_kinematics/arm"), {"solve_type": "Distance", "epsilon": 0.001}),
        (("parameters", "/robot_description_kinematics/arm"), {"mode": "bio2_memetic", "counter": False, "threads": 2}),
        (("parameters", "/robot_description_kinematics/arm/opw_kinematics_geometric_parameters"), {"a1": 0.1}),
        (("arguments", "physics_engine"), "mujoco"),
        (("arguments", "planner_name"), "PRM"),
    ],
)
def test_names_that_something_answers_to_are_taken(path: tuple[str, ...], value: object, tmp_path: Path) -> None:
    assert experiment_faults(changed_experiment(PLAIN, path, value), tmp_path) == ""


def test_a_misspelt_parameter_of_a_pipeline_in_a_configuration_package_is_refused() -> None:
    path = roslaunch.rlutil.resolve_launch_arguments(["modular_framework_api", "start_framework.launch"])[0]
    launch = preview_launch(path, [])

    def faults(name: str) -> list[str]:
        changed_launch = replace(launch, parameters={**launch.parameters, f"{PIPELINE}/{name}": 0.5})
        return [fault.text for fault in LaunchCheck(changed_launch).faults()]

    assert faults("jigle_fraction") == [
        "pipeline 'ompl' has no parameter 'jigle_fraction'; did you mean 'jiggle_fraction'?"
    ]
    assert faults("my_planner/weight") == []


def test_a_parameter_of_a_node_of_ones_own_is_taken_when_it_is_listed(tmp_path: Path) -> None:
    content = changed_experiment(TASK, ("parameters", "/my_node/gain"), 2.0)
    assert "extra_parameters" in experiment_faults(content, tmp_path)
    assert experiment_faults({**content, "extra_parameters": ["/my_node/gain"]}, tmp_path) == ""


def test_a_task_that_places_in_a_region_needs_the_region(tmp_path: Path) -> None:
    placing = {**PLAIN, "task": "pick_and_place.yaml"}
    goal = {"x": [0.1, 0.2], "y": [0.4, 0.5]}
    assert "the region 'goal' is unknown; there is none" in experiment_faults(placing, tmp_path)
    misspelt = experiment_faults({**placing, "regions": {"gaol": goal}}, tmp_path)
    assert "pick_and_place.yaml:" in misspelt and "allowed: gaol" in misspelt and "did you mean 'gaol'" in misspelt
    assert experiment_faults({**placing, "regions": {"goal": goal}}, tmp_path) == ""
    on_launch = changed_experiment(placing, ("arguments", "regions"), "{goal: {x: [0.1, 0.2], y: [0.4, 0.5]}}")
    assert experiment_faults(on_launch, tmp_path) == ""


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("support: table", "support: block_2", ""),
        ("support: table", "support: table__link", ""),
        ("support: table", "support: tabel", "model 'tabel' is unknown; allowed: block_1, block_2, ground_plane, "),
        ("node_name:", "external_names: {model: [tray]}\nnode_name:", ""),
        ("node_name:", "external_names: {modl: [tray]}\nnode_name:", "did you mean 'model'"),
    ],
)
def test_a_task_names_models_of_the_world_and_objects(old: str, new: str, fault: str, tmp_path: Path) -> None:
    faults = in_placing_task("pick_and_place.yaml", old, new, "").refusal_text(tmp_path)
    assert fault in faults and bool(faults) == bool(fault)


def test_all_faults_of_an_experiment_are_listed_at_once(tmp_path: Path) -> None:
    content = changed_experiment(
        TASK, ("parameters",), {"/planer_name": "$planner", "/robot_speed_factor": 7, "/max_torq": 1}
    )
    faults = experiment_faults(changed_experiment(content, ("arguments", "physics_engine"), "bullet"), tmp_path)
    assert all(word in faults for word in ("planer_name", "robot_speed_factor", "max_torq", "bullet")), faults


def _many_faults() -> dict:
    content = changed_experiment(TASK, ("parameters",), {"/planer_name": "$planer", "/robot_speed_factor": 7})
    content = changed_experiment(content, ("arguments", "physics_engine"), "bullet")
    return changed_experiment(changed_experiment(content, ("objects", 0, "model"), "cub"), ("metrics",), ["sucess"])


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("task",), "simulation_pik.yaml", ("simulation_pik", "/planer_name")),
        (("arguments", "world_file"), "none.world", ("none.world", "/planer_name")),
        (("arguments",), {"world_fil": "ur5_table.world", "physics_engine": "bullet"}, ("world_fil", "/planer_name")),
        (("arguments", "gui"), "maybe", ("'gui' is 'maybe'", "/planer_name")),
        (("stopping",), {"rule": "sequental"}, ("sequental", "/planer_name")),
    ],
    ids=str,
)
def test_a_fault_of_one_key_hides_no_fault_of_another(
    path: tuple[str, ...], value: object, words: tuple[str, ...], tmp_path: Path
) -> None:
    faults = experiment_faults(changed_experiment(_many_faults(), path, value), tmp_path)
    for word in (*words, "'$planer'", "'/robot_speed_factor' is 7", "is 'bullet'", "'cub'", "'sucess'"):
        assert word in faults, faults


def test_a_misspelt_robot_makes_no_names_of_the_default_robot_wrong(tmp_path: Path) -> None:
    content = changed_experiment(PLAIN, ("arguments", "moveit_config_package"), "panda_hand_moveit_confg")
    content = changed_experiment(content, ("parameters",), {"/arm_group_name": "panda_arm", "/robot_speed_factor": 7})
    faults = experiment_faults(content, tmp_path)
    assert faults.startswith("2 faults") and "moveit_confg" in faults and "'/robot_speed_factor' is 7" in faults


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            PLANNING
            | {"group": "pandaarm", "planner_parameters": {"rang": 1.0}, "parameters": {"/planer": 1, "/wold": 2}},
            ("pandaarm", "rang", "/planer", "/wold"),
        ),
        (
            KINEMATICS
            | {"solver": "trac_ikk", "factors": {"group": ["panda_arm", "panda_amr"]}, "parameters": {"/x": 1}},
            ("trac_ikk", "panda_amr", "/x"),
        ),
        (
            GRASPS
            | {
                "gripper_joint": "finger",
                "group": "panda_manipulatr",
                "method_parameters": {"yaw_stp": 0.1, "yaw_step": 9},
            },
            ("'finger'", "panda_manipulatr", "yaw_stp", "'yaw_step' is 9"),
        ),
        (GRASPS | {"robot": "panda_moveit_confg", "method_parameters": {"yaw_stp": 0.1}}, ("moveit_confg", "yaw_stp")),
    ],
    ids=lambda value: value["mode"] if isinstance(value, dict) else "",
)
def test_all_faults_of_modes_without_simulation_are_listed_at_once(
    content: dict, words: tuple[str, ...], tmp_path: Path
) -> None:
    write_problem(tmp_path)
    faults = experiment_faults(content, tmp_path)
    assert all(word in faults for word in words), faults


@pytest.mark.parametrize(
    ("solvers", "fault"),
    [
        (("", "closed form"), "the levels 'a' and 'b' of factor 'solver' run the same"),
        (("", "numeric"), ""),
        (("closed form", "numeric"), ""),
    ],
)
def test_two_solvers_that_resolve_to_the_same_method_are_refused_as_equal(
    solvers: tuple[str, str], fault: str, tmp_path: Path
) -> None:
    levels = {label: {"solver": solver} for label, solver in zip("ab", solvers, strict=True)}
    content = KINEMATICS | {"group": "panda_arm", "factors": {"solver": levels}, "compare": "solver"}
    faults = experiment_faults(content, tmp_path)
    assert fault in faults and bool(fault) == bool(faults), faults


RRT_RANGE = {"parameters": {f"{PIPELINE}/planner_configs/RRT/range": 0.4}}
OWN_PARAMETER = {"extra_parameters": ["/my_node/gain", "/move_group/max_safe_path_cost"]}
CHOOSE_RRT = SET_PLANNER.format("ompl/RRT")
OWN = "  - Own: {source: mine, outcomes: [success], transitions: {success: GenerateGrasps}}\n"
GOALS = [{"regions": {"goal": {"x": [low, 0.2], "y": [0.4, 0.5]}}} for low in (0.1, 0.15)]


@pytest.mark.parametrize(
    ("base", "first", "second"),
    [
        # a node of one's own may read the parameter
        (OWN_PARAMETER, {"parameters": {"/my_node/gain": 1}}, {"parameters": {"/my_node/gain": 2}}),
        (OWN_PARAMETER, {}, {"parameters": {"/move_group/max_safe_path_cost": 5}}),
        # the task uses the planner or the region
        ({}, {}, {"parameters": {f"{PIPELINE}/planner_configs/RRTConnect/range": 0.4}}),
        ({"task": "planner.yaml"}, {}, RRT_RANGE),
        ({"task": "pick_and_place.yaml"}, *GOALS),
        ({"task": "simulation_pick.yaml", "success": {"in_region": {"region": "goal"}}}, *GOALS),
        # a state of one's own may use any planner
        ({"task": "own.yaml"}, {}, RRT_RANGE),
    ],
    ids=str,
)
def test_levels_that_something_may_tell_apart_are_taken(base: dict, first: dict, second: dict, tmp_path: Path) -> None:
    script = Path(rospkg.RosPack().get_path("modular_framework_api")) / "task_constructor_scripts/pick_and_hold.yaml"
    for name, state in (("planner", CHOOSE_RRT), ("own", OWN)):
        (tmp_path / f"{name}.yaml").write_text(script.read_text().replace(FIRST_STATE, state + FIRST_STATE))
    (tmp_path / "states").mkdir()
    (tmp_path / "states" / "mine.py").write_text(OWN_STATE)
    levels = {"factors": {"level": {"first": first, "second": second}}, "compare": "level"}
    arguments = {**PLAIN["arguments"], "states_directory": str(tmp_path / "states")}
    assert experiment_faults({**PLAIN, **base, **levels, "arguments": arguments}, tmp_path) == ""


@pytest.mark.parametrize("content", [KINEMATICS, GRASPS], ids=lambda content: content["mode"])
def test_the_dry_run_of_a_mode_with_inverse_kinematics_shows_the_substituted_plugin(content: dict) -> None:
    text = yaml.safe_dump(content)
    found = read_experiment(text, Path("experiment.yaml"), RosResourceLookup(), known_metrics(), checks())
    line = "substitution: the framework's inverse kinematics for kdl_kinematics_plugin/KDLKinematicsPlugin"
    assert design_text(found, plan_episodes(found)).splitlines().count(f"  {line}") == 1


def test_the_dry_run_shows_substitutions_of_the_planners_that_only_the_task_names_and_of_the_collision_detector(
    tmp_path: Path,
) -> None:
    scripts = Path(rospkg.RosPack().get_path("modular_framework_api")) / "task_constructor_scripts"
    task = (scripts / "simulation_pick.yaml").read_text()
    (tmp_path / "task.yaml").write_text(task.replace(FIRST_STATE, SET_PLANNER.format("ompl/PRM") + FIRST_STATE))
    content = PLAIN | {
        "task": str(tmp_path / "task.yaml"),
        "parameters": {"/planner_name": "RRTstar", "/move_group/collision_detector": "Bullet"},
    }
    file = tmp_path / "experiment.yaml"
    found = read_experiment(yaml.safe_dump(content), file, RosResourceLookup(), known_metrics(), checks())
    lines = design_text(found, plan_episodes(found)).splitlines()
    for text in (
        "CBiRRT for RRTstar, which cannot keep path constraints",
        "CBiRRT for PRM, which cannot keep path constraints",
        "the framework's exact collision checker for Bullet",
    ):
        assert lines.count(f"  substitution: {text}") == 1, lines


def test_mode_planning_takes_the_parameters_that_it_reads(tmp_path: Path) -> None:
    write_problem(tmp_path)
    given = {
        PIPELINE: {"jiggle_fraction": 0.1, "panda_arm": {"default_planner_config": "RRT"}},
        "/move_group/search_threads": 1,
    }
    assert experiment_faults(PLANNING | {"parameters": given}, tmp_path) == ""


@pytest.mark.parametrize(
    "package", ["modular_framework_api", "panda_hand_robot", "iiwa_wsg50_robot", "dual_panda_robot"]
)
@pytest.mark.parametrize("method", ["top_down_grasps", "antipodal_grasps", "point_cloud_grasps"])
def test_what_is_shipped_names_only_what_is_there(package: str, method: str, tmp_path: Path) -> None:
    assert in_launch(f"method_launch_file:={method}/{method}.launch", "", package).refusal_text(tmp_path) == ""


def test_unchanged_hardware_and_controllers_are_in_order(tmp_path: Path) -> None:
    (tmp_path / "config").mkdir()
    assert in_hardware("UrArmRobotHW", "UrArmRobotHW", "").refusal_text(tmp_path / "config") == ""
    assert in_controllers("elbow_joint", "elbow_joint", "").refusal_text(tmp_path) == ""


def test_hardware_that_a_package_of_ones_own_exports_is_taken() -> None:
    script = """
from modular_framework_benchmark.launch_checks.ros_launch_check import LaunchCheck
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview
node = LaunchedNode("modular_framework_control", "robot_hw", "/robot_hw", "/")
for kind in ("my_arm/MyArm", "my_arm/MyArn"):
    print([fault.text for fault in LaunchCheck(LaunchPreview((node,), {"/robot_hw/type": kind})).faults()])
"""
    examples = Path(__file__).resolve().parents[3] / "docs" / "examples"
    environment = os.environ | {"ROS_PACKAGE_PATH": f"{examples}:{os.environ['ROS_PACKAGE_PATH']}"}
    printed = subprocess.run(
        [sys.executable, "-c", script], env=environment, check=True, capture_output=True, text=True
    ).stdout
    right, misspelt = printed.splitlines()
    assert right == "[]" and "did you mean 'my_arm/MyArm'" in misspelt


def test_wrong_settings_of_a_planner_that_only_the_task_names_are_refused(tmp_path: Path) -> None:
    text = (
        Path(rospkg.RosPack().get_path("modular_framework_api")) / "task_constructor_scripts/pick_and_hold.yaml"
    ).read_text()
    (tmp_path / "task.yaml").write_text(text.replace(FIRST_STATE, SET_PLANNER.format("ompl/RRT") + FIRST_STATE))
    path = roslaunch.rlutil.resolve_launch_arguments(["modular_framework_api", "start_framework.launch"])[0]
    launch = preview_launch(path, [f"task_constructor_script:={tmp_path / 'task.yaml'}"])
    of_file = {f"{PIPELINE}/planner_configs": {"RRT": {"type": "geometric::RRT", "goal_bias": 2.0}}}
    assert LaunchCheck(launch).faults() == []
    (fault,) = LaunchCheck(launch.with_parameters(of_file)).faults()
    assert fault.key == "task"
    assert "planner 'ompl/RRT', which the task names: " in fault.text and "'goal_bias' is '2.0'" in fault.text


def test_a_state_of_another_robot_is_no_fault(tmp_path: Path) -> None:
    case = in_config("named_joint_states.yaml", "other", {"linear_axis": 1.0}, "")
    assert case.refusal_text(tmp_path) == ""


def test_an_own_state_with_free_options_is_in_order(tmp_path: Path) -> None:
    assert in_script(OWN_TASK.format(name="own", option="gain: 3, "), "", OWN_STATE).refusal_text(tmp_path) == ""
