# SPDX-License-Identifier: BSD-3-Clause
"""spawn_model understands the command lines written for Gazebo."""

from __future__ import annotations

import pytest

from modular_framework_simulation.gazebo_ros.ros_names import SPAWN_SDF_MODEL, in_namespace
from modular_framework_simulation.gazebo_ros.spawn_model_command import Format, Source, parse_spawn_command
from modular_framework_simulation.models.poses import Pose


def test_a_full_command_line_is_understood() -> None:
    words = "-urdf -param robot_description -model r -x 1 -y -2.5 -z 3 -Y 0.5 -J a 1.5 -J b -2 -unpause -wait table"
    command = parse_spawn_command(words.split())
    assert (command.format, command.source, command.source_name) == (Format.URDF, Source.PARAM, "robot_description")
    assert command.pose == Pose.from_xyz_rpy((1, -2.5, 3), (0, 0, 0.5))
    assert command.joints == {"a": 1.5, "b": -2.0}
    assert (command.unpause, command.wait_for, command.bond) == (True, "table", False)


def test_a_short_one_stands_at_the_origin() -> None:
    command = parse_spawn_command("-sdf -stdin -model m -b".split())
    assert (command.format, command.source, command.source_name) == (Format.SDF, Source.STDIN, "")
    assert (command.pose, command.joints, command.bond) == (Pose(), {}, True)


def test_the_simulation_may_be_in_another_namespace_and_meshes_in_the_folders_of_models() -> None:
    words = "-sdf -stdin -model m -gazebo_namespace /other/ -robot_namespace /r -package_to_model -bond"
    command = parse_spawn_command(words.split())
    assert (command.namespace, command.package_to_model, command.bond) == ("/r", True, True)
    assert in_namespace(SPAWN_SDF_MODEL, command.gazebo_namespace) == "/other/spawn_sdf_model"
    assert in_namespace(SPAWN_SDF_MODEL, parse_spawn_command("-sdf -stdin -model m".split()).gazebo_namespace) == (
        SPAWN_SDF_MODEL
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("-sdf -file x", "-model"),
        ("-file x -model m", "-sdf -urdf"),
        ("-sdf -urdf -file x -model m", "not allowed with"),
        ("-sdf -model m", "-file -param -database -stdin"),
        ("-sdf -file x -model m -J a b", "joint 'a': got 'b'"),
        ("-sdf -file x -model m -x here", "-x"),
    ],
)
def test_a_wrong_command_line_is_explained(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse_spawn_command(words.split())
    assert said in capsys.readouterr().err
