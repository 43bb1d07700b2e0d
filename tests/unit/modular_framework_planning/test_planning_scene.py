# SPDX-License-Identifier: BSD-3-Clause
"""The scene: snapshots never change, attaching and detaching keep the place, bad geometry is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from pose_difference import pose_difference

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.errors import GeometryError, PlanningError, UnknownNameError
from modular_framework_planning.geometry.shapes import Box, Cylinder, Mesh, Plane, Sphere
from modular_framework_planning.geometry.spatial import make_transform
from modular_framework_planning.planning_interface.motion_problems import read_scene
from modular_framework_planning.planning_scene.allowed_collisions import AllowedCollisionMatrix, matrix_from_rows
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel

PALM = "ezgripper_palm_link"


def at(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def box(name: str, pose: pin.SE3, size: float = 0.1) -> CollisionObject:
    return CollisionObject(name, pose, ((Box(size, size, size), pin.SE3.Identity()),))


def upright(model: RobotModel) -> PlanningScene:
    positions = model.merge(model.default_positions(), {"shoulder_lift_joint": -1.57})
    return empty_scene(model, positions)


def test_a_change_makes_a_new_version_and_leaves_the_old_snapshot_alone(model: RobotModel) -> None:
    before = upright(model)
    after = before.with_object(box("b", at(1, 0, 1)))
    assert "b" not in before.objects and "b" in after.objects
    assert after.version > before.version


def test_move_append_and_remove_do_what_they_say(model: RobotModel) -> None:
    scene = upright(model).with_object(box("b", at(1, 0, 1)))
    scene = scene.with_shapes_appended(CollisionObject("b", at(1, 1, 1), ((Sphere(0.1), pin.SE3.Identity()),)))
    assert len(scene.objects["b"].shapes) == 2
    assert np.allclose((scene.objects["b"].pose * scene.objects["b"].shapes[1][1]).translation, [1, 1, 1])
    scene = scene.with_object_moved("b", at(0, 2, 0))
    assert np.allclose(scene.frame_transform("b").translation, [0, 2, 0])
    assert not scene.without_object("b").objects
    with pytest.raises(UnknownNameError, match="known: b"):
        scene.without_object("c")
    with pytest.raises(UnknownNameError, match="did you mean 'b'"):
        scene.without_object("B")


def test_an_attached_object_follows_its_link_and_stays_where_it_is_put_down(model: RobotModel) -> None:
    scene = upright(model)
    link = model.link_transforms(scene.positions)[PALM]
    body = box("held", pin.SE3.Identity(), 0.04)
    scene = scene.with_object(box("held", link)).with_attached(AttachedObject(body, PALM, frozenset({PALM})))
    assert "held" not in scene.objects
    moved = scene.with_positions(model.merge(scene.positions, {"shoulder_pan_joint": 1.0}))
    expected = model.link_transforms(moved.positions)[PALM]
    assert pose_difference(moved.attached_pose("held"), expected) == pytest.approx((0.0, 0.0), abs=1e-9)
    released = moved.with_detached("held")
    assert not released.attached
    assert np.allclose(released.objects["held"].pose.homogeneous, expected.homogeneous)


def test_touch_links_may_touch_and_others_may_not(model: RobotModel) -> None:
    scene = upright(model)
    gripper = frozenset(name for name in model.frame_ids if "ezgripper" in name)
    body = box("held", at(0, 0, 0.06), 0.03)
    with_touch = scene.with_attached(AttachedObject(body, PALM, gripper))
    without = scene.with_attached(AttachedObject(box("held", at(0, 0, 0.06), 0.3), PALM, frozenset()))
    assert not ExactCollisionChecker(with_touch).contacts(with_touch.positions)
    touching = ExactCollisionChecker(without).contacts(without.positions)
    assert touching, "a body around the fingers touches them"


def test_a_state_that_touches_an_object_says_which_link_touches_what_and_how_deep(model: RobotModel) -> None:
    scene = upright(model)
    wrist = model.link_transforms(scene.positions)["wrist_3_link"].translation
    scene = scene.with_object(box("wall", at(wrist[0], wrist[1], wrist[2] + 0.02)))
    contacts = ExactCollisionChecker(scene).contacts(scene.positions)
    assert any("wrist_3_link" in item.describe() and "'wall'" in item.describe() for item in contacts)
    assert all(item.depth > 0 for item in contacts)
    allowed = scene.with_acm(AllowedCollisionMatrix(scene.acm.entries, {"wall": True}, scene.acm.names))
    assert ExactCollisionChecker(allowed).is_free(scene.positions)


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.06),
        Cylinder(0.1, 0.05),
        Plane(0, 0, 1, 0),
        Mesh(
            np.array([[0, 0, -0.1], [0.1, 0, 0.1], [-0.1, 0.1, 0.1], [-0.1, -0.1, 0.1]], float),
            np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]]),
        ),
    ],
    ids=["sphere", "cylinder", "plane", "mesh"],
)
def test_every_kind_of_shape_is_hit_and_missed(model: RobotModel, shape: object) -> None:
    scene = upright(model)
    tip = model.link_transforms(scene.positions)["wrist_2_link"].translation
    for offset, free in ((0.0, False), (1.0, True)):
        placed = scene.with_object(CollisionObject("thing", at(*tip + [0, 0, offset]), ((shape, at(0, 0, 0)),)))
        assert ExactCollisionChecker(placed).is_free(scene.positions) is free


def test_an_empty_name_in_the_matrix_allows_no_contact(model: RobotModel) -> None:
    scene = upright(model)
    tip = model.link_transforms(scene.positions)["wrist_3_link"].translation
    scene = scene.with_object(box("wall", at(*tip)))
    for acm in (scene.acm.with_defaults({"": True}), scene.acm.with_entry("", "wrist_3_link", True)):
        assert not ExactCollisionChecker(scene.with_acm(acm)).is_free(scene.positions)


def test_defaults_hold_only_where_no_entry_speaks_and_both_must_allow() -> None:
    acm = AllowedCollisionMatrix({frozenset("ab"): False}, {"a": True, "c": True, "d": False})
    assert not acm.allows("a", "b")
    assert acm.allows("a", "x") and acm.allows("a", "c")
    assert not acm.allows("a", "d") and not acm.allows("x", "y")
    assert acm.with_entry("a", "b", True).allows("b", "a")


COARSE_ARM = """<robot name="r">
<link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<link name="upper"><collision><geometry><box size="0.1 0.1 0.3"/></geometry></collision></link>
<link name="upper_coarse"><collision><geometry><box size="0.5 0.5 0.5"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="f" type="fixed"><parent link="upper"/><child link="upper_coarse"/></joint></robot>"""


def touching(defaults: str) -> set[frozenset[str]]:
    """Bodies that touch: the coarse shape overlaps the base and both objects, the fine one only the held object."""
    srdf = f'<robot name="r"><group name="arm"><joint name="j"/></group>{defaults}</robot>'
    scene = empty_scene(RobotModel(COARSE_ARM, srdf)).with_object(box("crate", at(0.2, 0, 0.38)))
    held = CollisionObject("held", pin.SE3.Identity(), ((Box(0.1, 0.1, 0.1), at(0.2, 0.0, 0.0)),))
    scene = scene.with_attached(AttachedObject(held, "upper", frozenset()))
    contacts = ExactCollisionChecker(scene).contacts(scene.positions)
    return {frozenset((item.first.name, item.second.name)) for item in contacts}


def test_a_link_without_default_collisions_touches_nothing_but_what_is_enabled() -> None:
    held_by_the_coarse, base = frozenset({"upper_coarse", "held"}), frozenset({"upper_coarse", "base"})
    everything = {held_by_the_coarse, base, frozenset({"upper_coarse", "crate"}), frozenset({"held", "crate"})}
    assert touching("") == everything
    off = '<disable_default_collisions link="upper_coarse"/>'
    enabled = '<enable_collisions link1="base" link2="upper_coarse"/>'
    assert touching(off) == {frozenset({"held", "crate"})}
    assert touching(off + enabled) == {base, frozenset({"held", "crate"})}
    assert touching(off + '<disable_collisions link1="upper_coarse" link2="base"/>' + enabled) == {
        frozenset({"held", "crate"})
    }, "a disabled pair goes before an enabled one, wherever they stand"


def test_a_matrix_that_is_not_square_is_refused() -> None:
    with pytest.raises(ValueError, match="square matrix with one row"):
        matrix_from_rows(["a", "b"], [[True]], {})


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: Box(0.1, -1.0, 0.1), "y is -1.0"),
        (lambda: Sphere(float("nan")), "radius is nan"),
        (lambda: Cylinder(0.0, 0.1), "height is 0.0"),
        (lambda: Plane(0, 0, 0, 1), "no normal"),
        (lambda: Mesh(np.zeros((3, 3)), np.array([[0, 1, 7]])), "refers to vertex 7"),
        (lambda: Mesh(np.zeros((0, 3)), np.zeros((0, 3))), "0 vertices"),
        (lambda: Box(1.0, 1.0e30, 1.0), r"y is 1e\+30 m; .* at most 10000 m"),
        (lambda: Mesh(np.eye(3) * 1.0e30, np.array([[0, 1, 2]])), "too far away; .* 10000 m"),
        (lambda: make_transform((0, 0, 0), (0, 0, 0, 0)), "norm 0"),
        (lambda: make_transform((0, float("nan"), 0), (0, 0, 0, 1)), "not finite"),
    ],
)
def test_bad_geometry_is_refused_with_what_was_got(build: object, text: str) -> None:
    with pytest.raises(GeometryError, match=text):
        build()


def test_objects_without_shape_or_name_or_with_a_links_name_are_refused(model: RobotModel) -> None:
    scene = upright(model)
    for body in (CollisionObject("x", at(0, 0, 0), ()), box("", at(0, 0, 0)), box("forearm_link", at(0, 0, 0))):
        with pytest.raises(GeometryError):
            scene.with_object(body)
    with pytest.raises(PlanningError, match="link 'nowhere' does not exist"):
        scene.with_attached(AttachedObject(box("x", at(0, 0, 0)), "nowhere", frozenset()))
    with pytest.raises(UnknownNameError, match="frame 'nowhere'"):
        scene.frame_transform("nowhere")


def test_objects_of_a_problem_file_are_in_the_frame_it_names(model: RobotModel, tmp_path: Path) -> None:
    file = tmp_path / "scene0001.yaml"
    text = (
        "world: {collision_objects: [{id: crate, header: {frame_id: FRAME}, primitives: [{type: box, dimensions: "
        "[0.1, 0.1, 0.1]}], pose: {position: [0.1, 0.2, 0.3], orientation: [0, 0, 0, 1]}}]}\n"
    )
    for frame in ("", "tool0"):
        file.write_text(text.replace("FRAME", f"'{frame}'"))
        scene = read_scene(model, file)
        expected = scene.frame_transform(frame).act(np.array([0.1, 0.2, 0.3]))
        assert scene.objects["crate"].pose.translation == pytest.approx(expected)
    assert scene.frame_transform("tool0").translation != pytest.approx([0.0, 0.0, 0.0])
    file.write_text(text.replace("FRAME", "nowhere"))
    with pytest.raises(PlanningError, match="'nowhere'"):
        read_scene(model, file)
