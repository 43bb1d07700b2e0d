# SPDX-License-Identifier: BSD-3-Clause
"""World, planning scene, collision matrix and map of types agree on the objects, whoever adds or deletes them."""

from __future__ import annotations

import functools
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rospkg
import rospy
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import DeleteModel, GetLinkProperties, GetModelState, GetWorldProperties, SetModelState
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix

from modular_framework_benchmark.episodes import ros_world
from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_benchmark.records.perturbation import ObjectPerturbation
from modular_framework_core import srv
from modular_framework_core.scene.manage_object import parse_request, request_to_delete
from modular_framework_core.scene.ros_manage_object import RefusedError, delete, spawn
from modular_framework_testing.ros_session import until as wait_until

sys.path.insert(0, str(Path(__file__).parent))
from fake_planning_scene import FakePlanningScene  # noqa: E402

LAUNCH = """<launch>
  <param name="/simulation" value="true"/>
  <param name="/manipulator_prefix" value="palm"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch">
    <arg name="world_file" value="$(find modular_framework_description)/worlds/ur5_table.world"/>
    <arg name="model_path" value="$(find modular_framework_description)/models"/>
  </include>
  <node name="managers" pkg="modular_framework_core" type="managers" output="screen"/>
</launch>"""

ALL, NONE = (True, True, True, True), (False, False, False, False)

until = functools.partial(wait_until, timeout_s=20.0)


def call(name: str, kind: Any, *values: Any) -> Any:
    rospy.wait_for_service(name, 40.0)
    return rospy.ServiceProxy(name, kind)(*values)


@pytest.fixture(scope="module")
def scene(ros_session: Any) -> Iterator[FakePlanningScene]:
    fake = FakePlanningScene()
    ros_session.launch(LAUNCH)
    rows = [AllowedCollisionEntry([True, False]), AllowedCollisionEntry([False, True])]
    empty = AllowedCollisionMatrix(entry_names=["arm", "palm"], entry_values=rows)
    assert call("/set_init_acm", srv.SetInitACM, empty).success
    rospy.wait_for_service("/gazebo/spawn_sdf_model", 40.0)
    yield fake
    rospy.delete_param("/simulation")
    fake.shutdown()


def matrix() -> AllowedCollisionMatrix:
    return call("/get_modified_acm", srv.GetModifiedACM, srv.GetModifiedACMRequest.NOTHING, [], False).acm


def where(scene: FakePlanningScene, name: str) -> tuple[bool, bool, bool, bool]:
    """Whether world, planning scene, collision matrix and map of types have an object."""
    world = call("/gazebo/get_world_properties", GetWorldProperties).model_names
    mapped = call("/get_object_type", srv.GetGazeboType, name).success
    return name in world, f"{name}__link" in scene.objects, f"{name}__link" in matrix().entry_names, mapped


def add(name: str, *further: str, kind: str = "cube") -> None:
    models = f"{rospkg.RosPack().get_path('modular_framework_description')}/models"
    spawn(parse_request(["-n", name, "-t", kind, "-p", "0.1", "0.5", "0.9", *further], models))


def test_an_object_that_is_managed_comes_and_goes_everywhere(scene: FakePlanningScene) -> None:
    add("box_1", kind="gelatin_box")
    until(lambda: where(scene, "box_1") == ALL, "the object everywhere")
    delete(request_to_delete("box_1"))
    until(lambda: where(scene, "box_1") == NONE, "the object nowhere")


def test_an_object_deleted_in_gazebo_is_forgotten_everywhere_with_its_permissions(scene: FakePlanningScene) -> None:
    add("box_2")
    until(lambda: where(scene, "box_2") == ALL, "the object everywhere")
    touch = srv.GetModifiedACMRequest.MANIPULATOR_OBJECT_COLLISION
    allowed = call("/get_modified_acm", srv.GetModifiedACM, touch, ["box_2"], True).acm
    assert allowed.entry_values[allowed.entry_names.index("palm")].enabled[allowed.entry_names.index("box_2__link")]
    assert call("/gazebo/delete_model", DeleteModel, "box_2").success
    until(lambda: where(scene, "box_2") == NONE, "the object nowhere")
    add("box_2", kind="can")
    until(lambda: where(scene, "box_2") == ALL, "another object of that name everywhere")
    assert call("/get_object_type", srv.GetGazeboType, "box_2").object_type == "can"
    now = matrix()
    assert not now.entry_values[now.entry_names.index("palm")].enabled[now.entry_names.index("box_2__link")]
    delete(request_to_delete("box_2"))


def test_what_was_deleted_in_gazebo_at_once_can_be_spawned_again(scene: FakePlanningScene) -> None:
    add("box_3")
    assert call("/gazebo/delete_model", DeleteModel, "box_3").success
    add("box_3")
    until(lambda: where(scene, "box_3") == ALL, "the object everywhere")
    delete(request_to_delete("box_3"))


def test_a_spawn_that_fails_changes_nothing_anywhere(scene: FakePlanningScene, tmp_path: Path) -> None:
    broken = tmp_path / "model.sdf"
    broken.write_text("<sdf version='1.5'><model name='m'><link name='link'><collision name='c'/></link></model></sdf>")
    before = matrix()
    with pytest.raises(RefusedError, match="has no <geometry>"):
        add("box_4", "-f", str(broken))
    assert where(scene, "box_4") == NONE
    until(lambda: "table__link" in scene.objects, "the table")
    with pytest.raises(RefusedError, match="table"):
        add("table")
    assert where(scene, "table") == (True, True, False, False)
    assert matrix() == before


def test_a_delete_that_fails_changes_nothing_anywhere(scene: FakePlanningScene) -> None:
    add("box_5")
    until(lambda: where(scene, "box_5") == ALL, "the object everywhere")
    before = matrix()
    with pytest.raises(RefusedError, match="box_6"):
        delete(request_to_delete("box_6"))
    assert where(scene, "box_5") == ALL
    assert matrix() == before
    delete(request_to_delete("box_5"))
    until(lambda: where(scene, "box_5") == NONE, "the object nowhere")


def test_a_perturbed_object_has_its_mass_and_the_planning_scene_shows_it_displaced(scene: FakePlanningScene) -> None:
    perturbed = ObjectPerturbation(mass=3.0, pose_error=(0.03, -0.04))
    ros_world.spawn(PlacedObject("box_7", "cube", 0.1, 0.5, 0.891, scale=2.0, perturbed=perturbed))
    found = call("/gazebo/get_link_properties", GetLinkProperties, "box_7::link")
    # at constant density, the mass grows with the third power of the scale and the moments with the fifth
    assert (found.mass, found.ixx) == pytest.approx((3 * 2**3 * 0.1, 3 * 2**5 * 4.16666667e-05))
    until(lambda: "box_7__link" in scene.objects, "the object in the planning scene")
    assert scene.objects["box_7__link"].primitives[0].dimensions == pytest.approx((0.1, 0.1, 0.1))

    def difference() -> tuple[float, float, float]:
        true = call("/gazebo/get_model_state", GetModelState, "box_7", "world").pose.position
        seen = scene.poses["box_7__link"]
        return seen.x - true.x, seen.y - true.y, seen.z - true.z

    until(lambda: difference() == pytest.approx((0.03, -0.04, 0.0), abs=1.5e-3), "the displaced object")
    delete_answer = call("/gazebo/delete_model", DeleteModel, "box_7")
    assert delete_answer.success, delete_answer.status_message
    until(lambda: "box_7__link" not in scene.objects, "the object gone")


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (ModelState(), "the name of the model is empty"),
        (ModelState(model_name="a", reference_frame="table"), "the reference frame is 'table'; allowed: world"),
        (ModelState(model_name="a", pose=Pose(Point(), Quaternion(0, 0, 1, 0))), "the error has a rotation"),
        (ModelState(model_name="a", pose=Pose(Point(float("nan"), 0, 0), Quaternion())), "position"),
    ],
)
def test_a_wrong_error_of_perception_is_refused(scene: FakePlanningScene, state: ModelState, reason: str) -> None:
    found = call("/gazebo/set_perceived_pose_error", SetModelState, state)
    assert not found.success and reason in found.status_message
