# SPDX-License-Identifier: BSD-3-Clause
"""A wrong value of a launch argument of the framework is refused with the argument, the value and what is allowed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import roslaunch.config
import roslaunch.core
import roslaunch.rlutil
import rospkg

from modular_framework_core.launching.launch_arguments import check_arguments
from modular_framework_core.launching.launch_runner import EXIT_BAD_LAUNCH, LaunchSpec, run_launch
from modular_framework_core.launching.ros_argument_check import launched_files

API = "modular_framework_api"


@pytest.fixture
def start() -> str:
    return str(roslaunch.rlutil.resolve_launch_arguments([API, "start_framework.launch"])[0])


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["world_file:=ur5_setp.world"], "'ur5_setp.world', .* no such file; allowed: bin.world, .*'ur5_setup.world'?"),
        (["robot_urdf_file:=ur5.urdf"], "'ur5.urdf', .* no such file; allowed: .*; did you mean 'ur5.urdf.xacro'?"),
        (["robot_package:=ur5_ezgriper_robot"], "there is no such package; .*; did you mean 'ur5_ezgripper_robot'?"),
        (["moveit_config_package:=ur5_ezgripper_robot"], "has no .*/launch/move_group.launch"),
        (["simulation:=false", "scene_file:=ur5.scene"], "'ur5.scene', .* no such file; allowed: bin.scene"),
        (["simulation:=false", "connection_file:=no.yaml"], "'no.yaml', .*allowed: .*connection_emulators.yaml"),
        (["simulation:=false", "vendor_driver_file:=no.yaml"], "'no.yaml', .* no such file; allowed: connection_em"),
        (["vendor_driver_file:=no.yaml"], "'no.yaml' with simulation:=true; only a real robot has a driver; set "),
        (["real_time_factor:=fast"], "is 'fast'; allowed: a number, at least 0"),
        (["seed:=abc"], "is 'abc'; allowed: a whole number"),
        (["generated_state_machine_name:=a/b"], "is 'a/b', which must be letters, digits and underscores"),
        (["viewer_port:=-3"], "is -3; allowed: a whole number, at least 0 and at most 65535"),
        (["viewer_port:=70000"], "is 70000; allowed: a whole number, at least 0 and at most 65535"),
        (["viewer_port:=eight"], "is 'eight'; allowed: a whole number"),
        (["ui_port:=0"], "is 0; allowed: a whole number, at least 1"),
        (["regions:={a: ["], re.escape("is '{a: [', which is not valid YAML: ") + ".*; allowed: regions such as"),
        (["physics_engine:=bulet"], "is 'bulet'; allowed: pybullet, mujoco"),
    ],
)
def test_the_sentence_names_argument_value_and_what_is_allowed(start: str, arguments: list[str], sentence: str) -> None:
    argument = arguments[-1].partition(":=")[0]
    with pytest.raises(roslaunch.core.RLException, match=f"argument '{argument}' .*{sentence}"):
        check_arguments(start, arguments)


@pytest.mark.parametrize("name", ["named_poses.yaml", "named_joint_states.yaml", "named_trajectories.yaml"])
def test_a_broken_file_of_names_is_named_with_its_line(start: str, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "config"
    shutil.copytree(Path(rospkg.RosPack().get_path(API)) / "config", folder)
    (folder / name).write_text("a: 1\nb: [1\n")
    with pytest.raises(roslaunch.core.RLException, match=f"{name}:3: not valid YAML"):
        check_arguments(start, [f"config_directory:={folder}"])
    (folder / name).unlink()
    check_arguments(start, [f"config_directory:={folder}"])


def test_a_task_that_cannot_be_read_is_refused_before_anything_starts(start: str, tmp_path: Path) -> None:
    broken = tmp_path / "broken.yaml"
    broken.write_text("a: [1")
    for value, fault in ((str(broken), "is not valid YAML"), ("pick.yaml", "no such file; .*simulation_pick.yaml")):
        with pytest.raises(
            roslaunch.core.RLException, match=f"argument 'task_constructor_script' is '{value}'.*{fault}"
        ):
            check_arguments(start, [f"task_constructor_script:={value}"])
    check_arguments(start, [f"task_constructor_script:={broken}", "state_machine_to_load:=machine.py"])


@pytest.mark.parametrize(("text", "fault"), [("a: [1", "not valid YAML"), (None, "there is no such file")])
@pytest.mark.parametrize(
    ("file", "arguments"),
    [
        ("motion_planner_config.yaml", []),
        ("external_manipulator_connection.yaml", ["simulation:=false"]),
        ("sensor_plugins.yaml", ["octomap:=true"]),
    ],
)
def test_a_broken_or_missing_configuration_file_is_named(
    start: str, tmp_path: Path, file: str, arguments: list[str], text: str | None, fault: str
) -> None:
    folder = tmp_path / "config"
    shutil.copytree(Path(rospkg.RosPack().get_path(API)) / "config", folder)
    broken = folder / file
    broken.unlink() if text is None else broken.write_text(text)
    with pytest.raises(roslaunch.core.RLException, match=re.escape(f"'{folder}': {broken}:") + f".*{fault}"):
        check_arguments(start, [f"config_directory:={folder}", *arguments])
    if arguments:
        check_arguments(start, [f"config_directory:={folder}"])


def test_broken_files_of_world_and_robot_are_named_with_their_line(start: str, tmp_path: Path) -> None:
    (tmp_path / "broken.world").write_text("<sdf>\n<world>")
    below_root = "../" * 20
    for argument in ("world_file", "robot_urdf_file"):
        with pytest.raises(roslaunch.core.RLException, match=f"argument '{argument}' .*broken.world:2: not an XML"):
            check_arguments(start, [f"{argument}:={below_root}{tmp_path}/broken.world"])


@pytest.mark.parametrize(
    ("argument", "sentence"),
    [
        ("world_file:=ur5_setp.world", "argument 'world_file' is 'ur5_setp.world', and "),
        ("simulation:=maybe", "argument 'simulation' is 'maybe'; it must be true or false"),
        ("task_constructor_script:=/none.yaml", "argument 'task_constructor_script' is '/none.yaml': "),
    ],
)
def test_roslaunch_prints_the_sentence_before_its_own_error(
    start: str, capfd: pytest.CaptureFixture[str], argument: str, sentence: str
) -> None:
    with pytest.raises(roslaunch.core.RLException, match="checked_arguments"):
        roslaunch.config.load_config_default([(start, [argument])], None, verbose=False)
    fault, note = capfd.readouterr().err.splitlines()
    assert fault.startswith(sentence)
    assert note.startswith("Nothing was started.")


@pytest.mark.parametrize("argument", ["controller_file", "connection_file"])
def test_a_broken_file_of_controllers_or_hardware_is_named_with_its_line(
    start: str, tmp_path: Path, argument: str
) -> None:
    (tmp_path / "broken.yaml").write_text("arm:\n  type: [a\n")
    file = f"{'../' * 20}{tmp_path}/broken.yaml"
    with pytest.raises(roslaunch.core.RLException, match=f"argument '{argument}' .*broken.yaml:3: not valid YAML"):
        check_arguments(start, ["simulation:=false", f"{argument}:={file}"])


def test_plain_roslaunch_refuses_a_misspelt_argument_before_any_node(start: str) -> None:
    for words in ([start], [API, "start_framework.launch"]):
        command = ["roslaunch", *words, "--dump-params", "wrld_file:=bin.world", "gui:=false"]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        fault, note = ended.stderr.splitlines()[:2]
        assert fault.startswith("unknown argument 'wrld_file'; did you mean 'world_file'?; allowed: ")
        assert note.startswith("Nothing was started.")


@pytest.mark.parametrize("command", [["python3", "/usr/bin/rostest"], ["python3", "/usr/bin/roslaunch", "nothing"]])
def test_other_programs_and_launch_files_that_do_not_exist_are_left_to_themselves(command: list[str]) -> None:
    assert launched_files([*command, "no.launch", "wrld_file:=bin.world"]) == ([], [])


def test_a_robot_that_xacro_cannot_expand_ends_with_one_sentence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.xacro").write_text(
        '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">${nothing}</robot>'
    )
    file = f"{'../' * 20}{tmp_path}/bad.xacro"
    code = run_launch(LaunchSpec(API, "start_framework.launch", [f"robot_urdf_file:={file}"]), task_name="task")
    last = capfd.readouterr().err.splitlines()[-1]
    assert code == EXIT_BAD_LAUNCH
    assert last.startswith(f"run_framework: argument 'robot_urdf_file' is '{file}', which xacro cannot expand")
