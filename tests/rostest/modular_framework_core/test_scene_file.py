# SPDX-License-Identifier: BSD-3-Clause
"""A text scene ends up in the planning scene of move_group and comes back; exit codes say whether it did."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
import rospy
from moveit_msgs.msg import PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene
from shape_msgs.msg import SolidPrimitive

from modular_framework_testing.ros_session import executable

SCENE = Path(__file__).parents[3] / "src" / "modular_framework_description" / "scenes" / "ur5_setup.scene"


def publish(session, *arguments: object, node: str = "moveit_publish_scene_from_text") -> tuple[int, str]:
    done = subprocess.run(
        [executable("modular_framework_core", node), *map(str, arguments)],
        env=session.env,
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def session(ros_session):
    ros_session.wait_for_service("/apply_planning_scene", 150)
    return ros_session


def test_the_planning_scene_has_the_objects_of_the_file(session) -> None:
    code, text = publish(session, SCENE)
    assert code == 0, text
    proxy = rospy.ServiceProxy("/get_planning_scene", GetPlanningScene)
    wanted = PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.WORLD_OBJECT_GEOMETRY
    objects = {item.id: item for item in proxy(PlanningSceneComponents(wanted)).scene.world.collision_objects}
    assert set(objects) == {
        "ground_plane__link",
        "robot_pedestal__link",
        "table__link",
        "wood_block__link",
        "can__link",
        "l_bracket__link",
    }
    (can,) = objects["can__link"].primitives
    assert can.type == SolidPrimitive.CYLINDER
    assert can.dimensions[SolidPrimitive.CYLINDER_HEIGHT] == pytest.approx(0.115)
    assert can.dimensions[SolidPrimitive.CYLINDER_RADIUS] == pytest.approx(0.033)
    assert len(objects["table__link"].primitives) == 5


def test_a_file_that_is_no_scene_has_an_exit_code_of_its_own(session, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.scene"
    wrong.write_text("room\n* box\n1\nbottle\n")
    code, text = publish(session, wrong)
    assert code == 2
    assert "wrong.scene:4" in text


def test_an_exported_scene_has_the_same_objects_colours_and_subframes(session, tmp_path: Path) -> None:
    coloured = tmp_path / "coloured.scene"
    coloured.write_text(
        "room\n* cup\n1 2 3\n0 0 0 1\n1\ncylinder\n0.1 0.4\n0 0 0.5\n0 0 0 1\n0 1 0 0.5\n1\nhandle\n0 0 1\n0 0 0 1\n.\n"
    )
    code, text = publish(session, "--scene", coloured)
    assert code == 0, text
    exported = tmp_path / "exported.scene"
    code, text = publish(session, exported, node="moveit_export_scene_to_text")
    assert code == 0, text
    assert exported.read_text() == coloured.read_text(), "the scene was replaced, so there is only the cup"
    code, text = publish(session, "--old", exported, node="moveit_export_scene_to_text")
    assert code == 2 and "subframes" in text
    code, text = publish(session, tmp_path / "no" / "folder.scene", node="moveit_export_scene_to_text")
    assert code == 2 and "folder.scene" in text
    code, text = publish(session)
    assert code == 2 and "arguments" in text
