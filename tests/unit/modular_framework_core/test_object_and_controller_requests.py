# SPDX-License-Identifier: BSD-3-Clause
"""Command lines about objects, parameters about external controllers, and the map of object types."""

from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_core.launching.external_controllers import (
    ControllerNode,
    controller_node,
)
from modular_framework_core.managers.object_types import ObjectTypeError, ObjectTypes
from modular_framework_core.scene.manage_object import ObjectRequestError, parse_request
from modular_framework_ros.node_handle import ParameterError


@pytest.fixture
def models(tmp_path: Path) -> Path:
    (tmp_path / "box").mkdir()
    (tmp_path / "box" / "model.sdf").write_text("<sdf/>")
    return tmp_path


@pytest.mark.parametrize(
    "position",
    [["0.1", "-0.2", "0.3"], ["0.1 -0.2 0.3"], ["0.1,-0.2,0.3"], ["0.1, -0.2, 0.3"], ["0.1,", "-0.2,", "0.3"]],
)
def test_triplets_may_be_separated_by_spaces_or_commas(models: Path, position: list[str]) -> None:
    request = parse_request(["-t", "box", "-p", *position, "-o", "-0.1,0,1e-1"], str(models))
    assert request.position_m == (0.1, -0.2, 0.3)
    assert request.rpy_rad == (-0.1, 0.0, 0.1)


def test_the_name_defaults_to_the_type_and_to_the_folder_of_a_lone_file(models: Path) -> None:
    assert parse_request(["-t", "box"], str(models)).name == "box"
    request = parse_request(["-f", str(models / "box" / "model.sdf")], "")
    assert request.name == "box"
    assert request.object_type == str(models / "box" / "model.sdf")
    assert parse_request(["-t", "box", "-n", "mine"], str(models)).name == "mine"


def test_a_type_is_found_in_any_of_the_folders_of_models(models: Path) -> None:
    assert parse_request(["-t", "box"], f"{models / 'none'}:{models}").sdf_file == models / "box" / "model.sdf"


def test_deleting_needs_no_models(models: Path) -> None:
    request = parse_request(["-d", "True", "-n", "box", "-t", "", "-p", "0", "0", "0", "-r", "world", "-f", ""], "")
    assert request.delete
    assert request.sdf_file is None


def test_empty_options_of_a_launch_file_mean_the_defaults(models: Path) -> None:
    request = parse_request("-d false -n -t box -p 0 0 0 -o 0 0 0 -r world -f".split(), str(models))
    assert (request.name, request.delete, request.reference_frame) == ("box", False, "world")


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ([], "neither a name"),
        (["-n", "x"], "neither a type"),
        (["-t", "missing"], "no file"),
        (["-t", "box", "-p", "1", "2"], "three finite numbers"),
        (["-t", "box", "-p", "a", "b", "c"], "three numbers"),
        (["-d", "true"], "name of the object to delete"),
    ],
)
def test_a_request_that_makes_no_sense_is_explained(models: Path, arguments: list[str], hint: str) -> None:
    with pytest.raises(ObjectRequestError, match=hint):
        parse_request(arguments, str(models))


def test_spawning_by_type_needs_the_folder_of_the_models() -> None:
    with pytest.raises(ObjectRequestError, match="gazebo_model_path"):
        parse_request(["-t", "box"], "")


def test_an_empty_package_means_that_there_is_nothing_to_start() -> None:
    assert controller_node({"package_manipulator_action_server": ""}) is None


def test_the_parameters_name_the_node() -> None:
    node = controller_node(
        {
            "package_manipulator_action_server": "p",
            "manipulator_controller_action_server_type": "t",
            "manipulator_controller_node_name": "n",
        }
    )
    assert node == ControllerNode("p", "t", "n")


def test_missing_parameters_are_listed() -> None:
    with pytest.raises(ParameterError, match="package_manipulator_action_server"):
        controller_node({})
    with pytest.raises(ParameterError, match="manipulator_controller_node_name"):
        controller_node({"package_manipulator_action_server": "p", "manipulator_controller_action_server_type": "t"})


def test_an_object_name_is_taken_until_it_is_deleted() -> None:
    types = ObjectTypes()
    types.add("a", "box")
    with pytest.raises(ObjectTypeError, match="exists already"):
        types.add("a", "can")
    assert types.get("a") == "box"
    types.delete("a")
    for ask in (types.get, types.delete):
        with pytest.raises(ObjectTypeError, match="No object named 'a'"):
            ask("a")
    with pytest.raises(ObjectTypeError, match="needs a name"):
        types.add("", "box")


def test_types_follow_the_simulation_but_keep_what_is_about_to_be_spawned() -> None:
    types = ObjectTypes()
    types.add("cup", "mug")
    assert types.remove_missing(["table"]) == []
    assert types.remove_missing(["table", "cup"]) == []
    types.add("ball_1", "ball")
    assert types.remove_missing(["table"]) == ["cup"]
    with pytest.raises(ObjectTypeError, match=r"Registered: ball_1"):
        types.get("cup")
    types.add("cup", "can")
    assert types.remove_missing([]) == []
    assert types.get("cup") == "can"
