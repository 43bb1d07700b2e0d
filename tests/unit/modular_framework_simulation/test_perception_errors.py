# SPDX-License-Identifier: BSD-3-Clause
"""A perceived model is displaced in the planning scene, in the hand as it was at the grasp; the truth stays."""

from __future__ import annotations

import math

import pytest

from modular_framework_simulation.loop.perception_errors import PerceptionErrors
from modular_framework_simulation.loop.snapshots import HeldObject, LinkSnapshot, ModelSnapshot, WorldSnapshot
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Link

LINK = Link("link", Pose(), None, (), ())


def snapshot(cube: Pose, hand: Pose | None = None) -> WorldSnapshot:
    """A world with a cube and a can; a hand that is given holds the cube."""
    models = tuple(
        ModelSnapshot(name, 1, False, (LinkSnapshot(LINK, pose),))
        for name, pose in (("cube", cube), ("can", Pose((1.0, 2.0, 3.0))))
    )
    return WorldSnapshot(0.0, models, () if hand is None else (HeldObject("cube", "palm", hand),))


def cube_of(world: WorldSnapshot) -> Pose:
    return world.models[0].links[0].pose_in_world


def test_only_the_named_model_is_displaced_in_the_world_frame() -> None:
    errors = PerceptionErrors()
    errors.set("cube", (0.01, -0.02, 0.0))
    turned = Pose.from_xyz_rpy((0.5, 0.0, 0.1), (0.0, 0.0, 1.0))
    true = snapshot(turned)
    perceived = errors.perceived_snapshot(true)
    assert cube_of(perceived) == Pose((0.51, -0.02, 0.1), turned.quaternion)
    assert perceived.models[1] == true.models[1]
    assert cube_of(true) == turned


def test_the_error_turns_with_the_hand_and_is_that_of_the_world_again_after_the_release() -> None:
    errors = PerceptionErrors()
    errors.set("cube", (0.01, 0.0, 0.0))
    hand = Pose.from_xyz_rpy((0.0, 0.0, 1.0), (math.pi, 0.0, 0.4))
    at_grasp = errors.perceived_snapshot(snapshot(hand, hand))
    assert cube_of(at_grasp).position == pytest.approx((0.01, 0.0, 1.0))
    turned = Pose.from_xyz_rpy((0.0, 0.3, 1.0), (math.pi, 0.0, 0.4 + math.pi / 2))
    moved = errors.perceived_snapshot(snapshot(turned, turned))
    assert cube_of(moved).position == pytest.approx((0.0, 0.31, 1.0))
    in_hand = [pose.inverse() @ cube_of(world) for pose, world in ((hand, at_grasp), (turned, moved))]
    assert in_hand[0].distance_to(in_hand[1]) == pytest.approx((0.0, 0.0), abs=1e-7)
    released = errors.perceived_snapshot(snapshot(turned))
    assert cube_of(released).position == pytest.approx((0.01, 0.3, 1.0))


@pytest.mark.parametrize("removal", ["zero", "clear"])
def test_a_removed_error_leaves_the_true_snapshot(removal: str) -> None:
    errors = PerceptionErrors()
    errors.set("cube", (0.01, 0.0, 0.0))
    if removal == "zero":
        errors.set("cube", (0.0, 0.0, 0.0))
    else:
        errors.clear()
    true = snapshot(Pose())
    assert errors.perceived_snapshot(true) is true
