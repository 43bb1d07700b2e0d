# SPDX-License-Identifier: BSD-3-Clause
"""A launch file with the arguments of the original's start_framework.launch, which knows no config_directory."""

from __future__ import annotations

from pathlib import Path

import pytest
import roslaunch.config
import rospkg

SIMULATION = {
    "simulation": "true",
    "description_package": "modular_framework_description",
    "robot_package": "ur5_ezgripper_robot",
    "robot_urdf_file": "ur5_with_ezgripper.urdf.xacro",
    "world_file": "ur5_setup.world",
    "scene_file": "ur5_setup.scene",
    "urdf_args": "initial_z:=0.86",
    "moveit_config_package": "ur5_ezgripper_moveit_config",
    "controller_file": "ur5_ezgripper_controller_simulation.yaml",
    "starting_pose": "-J elbow_joint 1.3",
    "manipulator_prefix": "ezgripper",
    "states_directory": "$(find modular_framework_core)/src/modular_framework_core/states",
    "templates_directory": "$(find modular_framework_core)/templates",
    "state_machine_to_load": "",
    "task_constructor_script": "simulation_pick.yaml",
    "generated_state_machine_name": "simulation_pick.py",
}


def load(folder: Path, **more: str) -> roslaunch.config.ROSLaunchConfig:
    """What roslaunch makes of the file with more arguments; nothing is started."""
    file = folder / "start_framework.launch"
    arguments = "".join(f'<arg name="{name}" value="{value}"/>' for name, value in (SIMULATION | more).items())
    file.write_text(
        '<launch><include file="$(find modular_framework_core)/launch/run_framework_core.launch">'
        f"{arguments}</include></launch>"
    )
    return roslaunch.config.load_config_default([str(file)], None, verbose=False)


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> roslaunch.config.ROSLaunchConfig:
    return load(tmp_path_factory.mktemp("launch"))


def test_it_has_the_grasp_generator_and_a_launch_with_its_own_configuration_only_the_method_it_names(
    config: roslaunch.config.ROSLaunchConfig, tmp_path: Path
) -> None:
    configuration = str(Path(rospkg.RosPack().get_path("modular_framework_api")) / "config")
    own = load(tmp_path, config_directory=configuration)
    named = load(tmp_path, config_directory=configuration, method_launch_file="top_down_grasps/top_down_grasps.launch")
    without = load(tmp_path, method_launch_file="none")
    found = [any(node.package == "top_down_grasps" for node in each.nodes) for each in (config, own, named, without)]
    assert found == [True, False, True, False]


def api_launch() -> roslaunch.config.ROSLaunchConfig:
    """What roslaunch makes of the framework's own start_framework.launch."""
    file = Path(rospkg.RosPack().get_path("modular_framework_api")) / "launch" / "start_framework.launch"
    return roslaunch.config.load_config_default([str(file)], None, verbose=False)


@pytest.mark.parametrize("display", [":7", ""])
def test_with_a_display_windows_open_and_the_framework_stays_open_after_the_task(
    display: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", display)
    for launch in (load(tmp_path), api_launch()):
        task = next(node for node in launch.nodes if node.type == "run_task")
        assert any(node.package == "rviz" for node in launch.nodes) == bool(display)
        assert launch.params["/gazebo/gui"].value == bool(display)
        assert task.required == (not display)


def test_its_configuration_files_are_those_of_the_api_package(config: roslaunch.config.ROSLaunchConfig) -> None:
    folder = Path(rospkg.RosPack().get_path("modular_framework_api")) / "config"
    managers = next(node for node in config.nodes if node.name == "managers")
    assert managers.args.split() == [
        str(folder / f"named_{kind}.yaml") for kind in ("joint_states", "trajectories", "poses")
    ]
    assert config.params["/arm_group_name"].value == "arm_and_manipulator"
    assert config.params["/task/config_directory"].value == str(folder)


def test_its_states_folder_without_states_and_its_script_by_name_are_no_fault(
    config: roslaunch.config.ROSLaunchConfig, capsys: pytest.CaptureFixture[str]
) -> None:
    from modular_framework_core.task_constructor.pipeline import main

    given = [
        str(config.params[f"/task/{name}"].value)
        for name in ("task_constructor_script", "states_directory", "templates_directory")
    ]
    assert main(["--check", *given]) == 0
    said = capsys.readouterr()
    assert "task 'simulation_pick' is in order" in said.out and "states has no state" in said.err


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("pick_and_hold.yaml", "{api}/task_constructor_scripts/pick_and_hold.yaml"),
        ("{own}/mine.yaml", "{own}/mine.yaml"),
    ],
)
def test_a_task_is_given_by_its_name_or_by_its_path_and_1_is_a_simulation(
    tmp_path: Path, given: str, expected: str
) -> None:
    (tmp_path / "mine.yaml").write_text("name: mine")
    api = rospkg.RosPack().get_path("modular_framework_api")
    arguments = [f"task_constructor_script:={given.format(own=tmp_path)}", "simulation:=1"]
    file = f"{api}/launch/start_framework.launch"
    params = roslaunch.config.load_config_default([(file, arguments)], None, verbose=False).params
    assert params["/task/task_constructor_script"].value == expected.format(api=api, own=tmp_path)
    assert params["/use_sim_time"].value is True and params["/simulation"].value is True
