# SPDX-License-Identifier: BSD-3-Clause
"""What RViz shows of the planning scene: objects in their own colours and opaque, the robot's ghost transparent."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

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
    monkeypatch.setattr(scene_markers.rospy, "Publisher", lambda *_, **__: None)
    monkeypatch.setattr(scene_markers, "publish", lambda _, message: messages.append(message))
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
