# SPDX-License-Identifier: BSD-3-Clause
"""What RViz shows: objects in their own colours and opaque, plans and motions without hiding the robot."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from moveit_msgs.msg import MotionPlanResponse
from visualization_msgs.msg import Marker

from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.move_group.markers import scene_markers
from modular_framework_planning.planning_scene.planning_scene import AttachedObject, CollisionObject, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel

RED = (0.75, 0.12, 0.12, 1.0)


def box(name: str) -> CollisionObject:
    return CollisionObject(
        name, pin.SE3(np.eye(3), np.array([0.5, 0.0, 1.0])), ((Box(0.1, 0.1, 0.1), pin.SE3.Identity()),)
    )


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The messages that were published."""
    messages: list[Any] = []
    picture = SimpleNamespace(show=lambda draw: messages.append(draw()))
    monkeypatch.setattr(scene_markers.rospy, "Publisher", lambda *_, **__: None)
    monkeypatch.setattr(scene_markers, "PicturePublisher", lambda *_: picture)
    monkeypatch.setattr(scene_markers, "publish", lambda *_: None)
    return messages


def test_objects_have_their_own_colours_and_are_opaque_without_one_too(model: RobotModel, published: list[Any]) -> None:
    scene = empty_scene(model, model.default_positions()).with_object(box("can")).with_object(box("crate"))
    held = AttachedObject(box("held"), "ezgripper_palm_link", frozenset())
    scene = scene.with_attached(held).with_colors({"can": RED, "held": RED})
    scene_markers.MarkerPublisher("world").show_scene(scene)
    colours = {marker.ns: marker.color for marker in published[0].markers[1:]}
    for name in ("can", "held"):
        assert (colours[name].r, colours[name].g, colours[name].b, colours[name].a) == pytest.approx(RED)
    assert colours["crate"].a == 1.0


def test_a_plan_is_a_line_and_the_hand_where_the_motion_ends(model: RobotModel, published: list[Any]) -> None:
    scene, group = empty_scene(model, model.default_positions()), model.group("arm_and_manipulator")
    rows = scene.positions[group.indices] + np.linspace(0.0, 0.5, 10)[:, None]
    answer: Any = SimpleNamespace(trajectory=SimpleNamespace(positions=rows), start=scene.positions)
    scene_markers.MarkerPublisher("world").show_path(scene, MotionPlanResponse(group_name=group.name), answer)
    markers = [marker for marker in published[-1].markers if marker.action == Marker.ADD]
    line, *ghost = markers
    end = scene.positions.copy()
    end[group.indices] = rows[-1]
    tips = [model.link_transforms(positions)[group.tip_link].translation for positions in (scene.positions, end)]
    ends = [(point.x, point.y, point.z) for point in (line.points[0], line.points[-1])]
    assert ends == [pytest.approx(tip) for tip in tips]
    meshes = {marker.mesh_resource.rpartition("/")[2] for marker in ghost if marker.mesh_resource}
    assert meshes == {"wrist3.dae"}, "of the arm only the link that carries the hand"
    assert any(marker.type != Marker.MESH_RESOURCE for marker in ghost), "palm and fingers are primitives"


def test_each_motion_under_way_has_a_line_until_it_has_ended(model: RobotModel, published: list[Any]) -> None:
    scene, group = empty_scene(model, model.default_positions()), model.group("arm_and_manipulator")
    markers = scene_markers.MarkerPublisher("world")
    rows = scene.positions[group.indices] + np.linspace(0.0, 0.5, 10)[:, None]

    def lines() -> int:
        return sum(marker.type == Marker.LINE_STRIP for marker in published[-1].markers)

    with markers.shown_motion(scene, group.joints, rows):
        assert lines() == 1
        with markers.shown_motion(scene, group.joints, rows):
            assert lines() == 2
        assert lines() == 1
        with markers.shown_motion(scene, group.joints[:2], rows[:, :2]):
            assert lines() == 1, "no group has these joints"
    first = published[-1].markers[0]
    assert lines() == 0 and (first.action, first.header.frame_id) == (Marker.DELETEALL, "world")
