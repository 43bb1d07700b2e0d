# SPDX-License-Identifier: BSD-3-Clause
"""The command state_machine_generator: the original's four arguments, and --check."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from task_folders import GOOD_TASK, TEMPLATES, write_states

from modular_framework_core.task_constructor.pipeline import directories_from, main

ONE_STATE = (
    "name: t\nsource: framework_state_machine\noutcomes: [done, gave_up]\nstates:\n"
    "  - A: {%s, transitions: {success: done, fail: gave_up}}\n"
)


@pytest.fixture()
def arguments(tmp_path: Path) -> list[str]:
    (tmp_path / "t.yaml").write_text(GOOD_TASK)
    return [str(tmp_path / "t.yaml"), str(write_states(tmp_path)), str(TEMPLATES), str(tmp_path / "out")]


def test_four_arguments_write_the_module_and_print_where(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 0
    written = Path(arguments[3]) / "tiny.py"
    assert written.is_file()
    assert capsys.readouterr().out.strip() == str(written)


def test_what_roslaunch_appends_is_ignored(arguments: list[str]) -> None:
    assert main([*arguments, "__name:=generator", "__log:=/dev/null"]) == 0


def test_check_writes_nothing(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*arguments[:3], "--check"]) == 0
    assert "task 'tiny' is in order, 2 states" in capsys.readouterr().out
    assert not Path(arguments[3]).exists()


def test_a_faulty_task_gives_1_its_faults_and_no_file(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    Path(arguments[0]).write_text(GOOD_TASK.replace("source: plan", "source: paln"))
    assert main(arguments) == 1
    captured = capsys.readouterr()
    assert f"{arguments[0]}:6:15: state 'A': source 'paln' is unknown" in captured.err
    assert not Path(arguments[3]).exists()


@pytest.mark.parametrize("position", [0, 1, 2])
def test_a_path_that_is_not_there_gives_1_and_is_named(
    arguments: list[str], position: int, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments[position] = "/nowhere/gone"
    assert main(arguments) == 1
    assert "/nowhere/gone" in capsys.readouterr().err


def test_states_of_ones_own_are_found_beside_the_frameworks_and_a_folder_without_any_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "open_door.py").write_text(
        "from modular_framework_core.state_api.framework_state import FrameworkState\n\n\n"
        'class OpenDoor(FrameworkState):\n    """Opens the door."""\n\n    def execute(self, userdata):\n'
        "        return self.succeed()\n"
    )
    assert main(["--explain", "open_door", str(tmp_path)]) == 0
    assert "Opens the door." in capsys.readouterr().out
    assert main(["--explain", "open_door", "", str(tmp_path)]) == 0
    capsys.readouterr()
    assert main(["--schema", str(tmp_path)]) == 0
    assert {"state_open_door", "state_plan"} <= set(json.loads(capsys.readouterr().out)["definitions"])
    script = tmp_path / "t.yaml"
    script.write_text(ONE_STATE % "source: open_door")
    assert main(["--check", str(script), str(tmp_path)]) == 0
    (tmp_path / "empty").mkdir()
    script.write_text(ONE_STATE % "source: move")
    assert main(["--check", str(script), str(tmp_path / "empty")]) == 0
    assert f"states directory {tmp_path}/empty has no state" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (
            "source: plan, target_state_type: joint_state, target_state_name: stabilty_pose",
            "did you mean 'stability_pose'?",
        ),
        ("source: plan, target_state_type: pose, target_state_name: nowhere", "the pose 'nowhere' is unknown"),
        (
            "source: plan, group: arn, target_state_type: joint_state, target_state_name: initial_pose",
            "planning group 'arn' is unknown",
        ),
        ("source: cartesian_move, pose_name: nowhere", "the pose 'nowhere' is unknown"),
        ("source: execute_trajectory, trajectory_name: exmple_trajectory", "did you mean 'example_trajectory'?"),
        ("source: gripper, posture: opened", "the posture 'opened' is unknown; allowed: "),
        (
            "source: select, message_type: pose, message_names: [nowhere], output_keys: [selected_pose]",
            "'nowhere' is unknown",
        ),
        ("source: select, message_type: grasp", "'grasp' writes the userdata key 'selected_grasp'"),
        (
            "source: move, plan_name: to_nowhere",
            "the plan 'to_nowhere' is unknown; there is none; store it with a state",
        ),
        (
            "source: plan, target_state_type: grasp, target_state_name: userdata",
            "takes the userdata key 'selected_grasp'",
        ),
        (
            "source: allow_manipulator_collisions, allow: true, collision_type: object-collision, objects: userdata",
            "takes the userdata key 'selected_grasp'",
        ),
        (
            "source: grasp, grasp_type: grasp, io_keys: [max_torque]",
            "takes the userdata key 'manipulator_controller_client'",
        ),
        ("source: log_metric, name_of_metric: a, from_key: force", "takes the userdata key 'force'"),
        ("source: call_service, service_name: s, request: {data: userdata.force}", "takes the userdata key 'force'"),
        ("source: call_action, action_name: a, keep: {pose: result}", "writes the userdata key 'pose'"),
        ("source: wait_for_message, topic_name: t, expect: {data: userdata.force}", "takes the userdata key 'force'"),
    ],
)
def test_names_that_are_nowhere_and_keys_that_are_not_declared_are_found_without_running(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], state: str, reason: str
) -> None:
    script = tmp_path / "t.yaml"
    script.write_text(ONE_STATE % state)
    assert main(["--check", str(script)]) == 1
    message = capsys.readouterr().err
    assert reason in message and message.startswith("1 fault in the task:\n"), message


def test_a_plan_that_another_state_makes_under_another_name_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "t.yaml"
    plans = (
        "source: plan, target_state_type: joint_state, target_state_name: stability_pose, "
        "plan_name: to_stability, transitions: {success: B, fail: gave_up}"
    )
    moves = "  - B: {source: move, plan_name: %s, transitions: {success: done, fail: gave_up}}\n"
    text = (ONE_STATE % plans).replace(", transitions: {success: done, fail: gave_up}}", "}")
    script.write_text(text + moves % "to_stability")
    assert main(["--check", str(script)]) == 0, capsys.readouterr().err
    script.write_text(text + moves % "to_stabilty")
    assert main(["--check", str(script)]) == 1
    assert "'to_stabilty' is unknown; allowed: to_stability; store it with a state" in capsys.readouterr().err


def test_names_that_another_node_adds_are_named_in_the_task_and_other_configurations_are_chosen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "t.yaml"
    moves = ONE_STATE % "source: move, plan_name: homing"
    script.write_text(f"external_names: {{plan: [homing]}}\n{moves}")
    assert main(["--check", str(script)]) == 0
    (tmp_path / "named_joint_states.yaml").write_text("mine: {a: 1.0}\n")
    script.write_text(ONE_STATE % "source: plan, target_state_type: joint_state, target_state_name: mine")
    assert main(["--check", str(script)]) == 1
    assert main(["--check", "--config", str(tmp_path), str(script)]) == 0
    (tmp_path / "named_joint_states.yaml").write_text("- mine\n")
    assert main(["--check", "--config", str(tmp_path), str(script)]) == 1
    assert f"{tmp_path}/named_joint_states.yaml must be a mapping of names" in capsys.readouterr().err
    adds = "  - B: {source: call_service, service_name: add_plan, transitions: {success: A, fail: gave_up}}\n"
    script.write_text(f"initial_state: B\n{moves}{adds}")
    assert main(["--check", str(script)]) == 0, capsys.readouterr().err


def test_a_name_that_a_state_of_ones_own_or_a_service_is_called_with_may_be_made_by_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "t.yaml"
    makes = (
        "  - B: {source: call_service, service_name: my_planner, request: {name: %s}, "
        "transitions: {success: A, fail: gave_up}}\n"
    )
    moves = "initial_state: B\n" + ONE_STATE % "source: move, plan_name: homing"
    script.write_text(moves + makes % "homing")
    assert main(["--check", str(script)]) == 0, capsys.readouterr().err
    script.write_text(moves + makes % "homming")
    assert main(["--check", str(script)]) == 1
    assert "the plan 'homing' is unknown" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "reason"),
    [
        (["--config", "/nowhere"], "configuration folder /nowhere is not a directory"),
        (["--moveit-config", "no_such_config"], "package 'no_such_config' is not found"),
    ],
)
def test_a_configuration_that_is_not_there_is_refused_and_not_left_unchecked(
    arguments: list[str], capsys: pytest.CaptureFixture[str], option: list[str], reason: str
) -> None:
    assert main(["--check", *arguments[:3], *option]) == 1
    assert reason in capsys.readouterr().err


def test_a_task_that_is_not_there_is_named_with_those_that_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--check", "simulation_pik.yaml"]) == 1
    message = capsys.readouterr().err
    assert (
        "there is no such file; allowed: clear_table.yaml, pick_and_hold.yaml, pick_and_place.yaml, "
        "simulation_pick.yaml, stack.yaml; did you mean" in message
    )


def test_several_directories_are_separated_by_colons() -> None:
    assert directories_from("/a:/b:") == [Path("/a"), Path("/b")]
    assert directories_from("") == []


def test_the_frameworks_own_folders_are_taken_when_none_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "t.yaml"
    script.write_text(
        "name: t\nsource: framework_state_machine\noutcomes: [done, gave_up]\nstates:\n"
        "  - A: {source: move, transitions: {success: done, fail: gave_up}}\n"
    )
    assert main(["--check", str(script)]) == 0, capsys.readouterr().err
