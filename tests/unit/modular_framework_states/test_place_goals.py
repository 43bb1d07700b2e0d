# SPDX-License-Identifier: BSD-3-Clause
"""How a held object is put down follows from its pose in the hand and from the approach of its grasp."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene
from scipy.spatial.transform import Rotation
from shape_msgs.msg import SolidPrimitive

from modular_framework_states import link_poses, place_goals
from modular_framework_states.place_goals import place_locations, read_place_scene
from modular_framework_states.place_poses import PlaceError, PlacePose

DOWN = Rotation.from_euler("y", math.pi / 2)  # x of the tip points down
COMMANDER = SimpleNamespace(group=SimpleNamespace(tip_link="tip"), current_joints=lambda: {"j": 0.0})


def pose(position: tuple[float, float, float], rotation: Rotation) -> Pose:
    return Pose(Point(*position), Quaternion(*rotation.as_quat()))


def box(name: str, frame: str, where: Pose) -> CollisionObject:
    message = CollisionObject(id=name, pose=where)
    message.header.frame_id = frame
    message.primitives, message.primitive_poses = [SolidPrimitive(1, [0.05, 0.05, 0.1])], [Pose()]
    return message


def stage(position: tuple[float, float, float]) -> SimpleNamespace:
    stamped = PoseStamped(pose=pose(position, DOWN))
    stamped.header.frame_id = "world"
    return SimpleNamespace(pose=stamped)


GRASP = SimpleNamespace(object_id="cube", grasp_id="1", pregrasp=stage((0.0, 0.03, 1.1)), grasp=stage((0.0, 0.0, 1.0)))


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> PlanningScene:
    """A table and a cube in the hand, which has turned by 90 degrees about the vertical since the grasp."""
    message, turned = PlanningScene(), Rotation.from_euler("z", math.pi / 2) * DOWN
    in_palm = pose((0.1, 0.0, 0.0), DOWN.inv() * Rotation.from_euler("z", 0.2))
    message.robot_state.attached_collision_objects = [
        AttachedCollisionObject(link_name="palm", object=box("cube__link", "palm", in_palm))
    ]
    message.world.collision_objects = [box("table__link", "world", pose((0.0, 0.0, 0.0), Rotation.identity()))]

    def request_service(name: str, kind: Any, request: Any, timeout_s: float) -> SimpleNamespace:
        if name == "get_planning_scene":
            return SimpleNamespace(scene=message)
        assert request.fk_link_names == ("tip", "palm")
        stamped = [PoseStamped(pose=pose((0.4, 0.0, 1.2), turned)) for _ in request.fk_link_names]
        stamped[0].header.frame_id = "world"
        return SimpleNamespace(pose_stamped=stamped)

    for module in (place_goals, link_poses):
        monkeypatch.setattr(module, "request_service", request_service)
    return message


def test_the_object_is_oriented_as_at_the_grasp_and_the_hand_goes_back_as_it_came(scene: PlanningScene) -> None:
    found = read_place_scene(COMMANDER, GRASP, "table")
    assert (found.held, found.support, found.frame) == ("cube__link", "table__link", "world")
    assert (found.orientation * Rotation.from_euler("z", 0.2).inv()).magnitude() == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(found.retreat, [-0.1, 0.03, 0.0])
    assert np.allclose(np.ptp(found.solids[0].vertices, axis=0), [0.05, 0.05, 0.1])
    place = PlacePose(np.array([0.3, 0.0, 0.9]), Rotation.identity())
    first, second = place_locations(found, [place, place], {"finger": 0.04})
    assert first.quality > second.quality
    assert first.post_place_posture.joint_names == ["finger"]
    retreat = first.post_place_retreat
    assert retreat.direction.header.frame_id == "tip" and retreat.desired_distance == pytest.approx(
        math.hypot(0.1, 0.03)
    )
    assert first.pre_place_approach.direction.vector.z == -1.0
    many = place_locations(found, [place] * 1000, {"finger": 0.04})
    assert [location.id for location in many] == [f"place {index}" for index in range(72)], "they share 10 s"


@pytest.mark.parametrize(
    ("change", "support", "reason"),
    [
        ("held", "table", "the hand should hold 'cube'; attached objects: none"),
        ("", "tabel", "0 objects of the planning scene are named 'tabel'; allowed: table__link"),
        ("solid", "table", "'table__link' has no solid part"),
    ],
)
def test_a_missing_object_or_support_is_named(scene: PlanningScene, change: str, support: str, reason: str) -> None:
    if change == "held":
        scene.robot_state.attached_collision_objects = []
    if change == "solid":
        scene.world.collision_objects[0].primitives = []
        scene.world.collision_objects[0].primitive_poses = []
    with pytest.raises(PlaceError) as fault:
        read_place_scene(COMMANDER, GRASP, support)
    assert reason in str(fault.value)
