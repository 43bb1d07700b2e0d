# SPDX-License-Identifier: BSD-3-Clause
"""A text scene ends up in the planning scene of move_group, and the exit code says whether it did."""
from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
import rospy
from moveit_msgs.msg import PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene
from shape_msgs.msg import SolidPrimitive

SCENE = Path(__file__).parents[3] / "src" / "modular_framework_description" / "scenes" / "ur5_setup.scene"
LAUNCH = """<launch><include file="$(find ur5_ezgripper_moveit_config)/launch/move_group.launch">
  <arg name="load_robot_description" value="true"/></include></launch>"""


def publish(session, path: Path) -> tuple[int, str]:
    done = subprocess.run(["rosrun", "modular_framework_core", "moveit_publish_scene_from_text", str(path)],
                          env=session.env, capture_output=True, text=True, timeout=90, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def session(ros_launch):
    started = ros_launch(LAUNCH)
    started.wait_for_service("/apply_planning_scene", 60)
    return started


def test_the_planning_scene_has_the_objects_of_the_file(session) -> None:
    code, text = publish(session, SCENE)
    assert code == 0, text
    proxy = rospy.ServiceProxy("/get_planning_scene", GetPlanningScene)
    wanted = PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.WORLD_OBJECT_GEOMETRY
    objects = {item.id: item for item in proxy(PlanningSceneComponents(wanted)).scene.world.collision_objects}
    assert set(objects) == {"ground_plane__link", "robot_pedestal__link", "table__link", "wood_block__link",
                            "can__link", "l_bracket__link"}
    can, = objects["can__link"].primitives
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
