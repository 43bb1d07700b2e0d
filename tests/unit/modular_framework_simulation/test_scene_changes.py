# SPDX-License-Identifier: BSD-3-Clause
"""A planning scene is told what changed in the world, and nothing else."""

from __future__ import annotations

from modular_framework_simulation.poses import Pose
from modular_framework_simulation.scene_changes import Attach, Detach, Move, Put, Remove, SceneChanges
from modular_framework_simulation.sdf_specs import Link
from modular_framework_simulation.snapshots import HeldObject, LinkSnapshot, ModelSnapshot, WorldSnapshot

LINK = Link("link", Pose(), None, (), ())
CUBE = ("cube", "link")


def at(x: float) -> Pose:
    return Pose((x, 0.0, 0.0))


def snapshot(x: float | None = 0.0, held_at: float | None = None, instance: int = 1) -> WorldSnapshot:
    """The world with a cube at x, in the hand when the hand's position is given."""
    models = ()
    if x is not None:
        models = (ModelSnapshot("cube", instance, False, (LinkSnapshot(LINK, at(x)),)),)
    held = HeldObject("cube", "palm", at(held_at)) if held_at is not None else None
    return WorldSnapshot(0.0, models, held)


def told(*snapshots: WorldSnapshot) -> SceneChanges:
    changes = SceneChanges()
    for each in snapshots:
        changes.towards(each)
        changes.confirm()
    return changes


def test_a_new_object_is_put_once() -> None:
    changes = SceneChanges()
    assert changes.towards(snapshot(0.0)) == [Put(CUBE, LINK, at(0.0))]
    changes.confirm()
    assert changes.towards(snapshot(0.0)) == []


def test_what_was_not_confirmed_is_told_again() -> None:
    changes = SceneChanges()
    changes.towards(snapshot(0.0))
    assert changes.towards(snapshot(0.0)) == [Put(CUBE, LINK, at(0.0))]


def test_movements_count_from_one_millimetre_and_add_up() -> None:
    changes = told(snapshot(0.0))
    assert changes.towards(snapshot(0.0008)) == []
    changes.confirm()
    assert changes.towards(snapshot(0.0016)) == [Move(CUBE, at(0.0016))]


def test_a_turn_of_a_hundredth_radian_counts() -> None:
    turned = Pose.from_xyz_rpy((0, 0, 0), (0, 0, 0.02))
    world = WorldSnapshot(0.0, (ModelSnapshot("cube", 1, False, (LinkSnapshot(LINK, turned),)),), None)
    assert told(snapshot(0.0)).towards(world) == [Move(CUBE, turned)]


def test_a_deleted_object_is_removed_and_one_spawned_again_is_replaced() -> None:
    assert told(snapshot(0.0)).towards(snapshot(None)) == [Remove(CUBE)]
    assert told(snapshot(0.0)).towards(snapshot(0.0, instance=2)) == [Remove(CUBE), Put(CUBE, LINK, at(0.0))]


def test_a_held_object_is_attached_and_may_travel_with_the_hand() -> None:
    changes = told(snapshot(0.0))
    assert changes.towards(snapshot(0.0, held_at=-1.0)) == [Attach(CUBE, LINK, "palm", at(1.0))]
    changes.confirm()
    assert changes.towards(snapshot(0.5, held_at=-0.5)) == []


def test_slip_in_the_hand_is_told() -> None:
    changes = told(snapshot(0.0, held_at=-1.0))
    assert changes.towards(snapshot(0.0, held_at=-1.002)) == [Attach(CUBE, LINK, "palm", at(1.002))]


def test_a_released_object_is_detached_and_put_where_it_is() -> None:
    changes = told(snapshot(0.0, held_at=-1.0))
    assert changes.towards(snapshot(0.3)) == [Detach(CUBE, "palm"), Put(CUBE, LINK, at(0.3))]


def test_a_held_object_that_is_deleted_is_detached_and_removed() -> None:
    assert told(snapshot(0.0, held_at=-1.0)).towards(snapshot(None)) == [Detach(CUBE, "palm"), Remove(CUBE)]


def test_a_receiver_that_was_started_again_is_told_everything() -> None:
    changes = told(snapshot(0.0, held_at=-1.0))
    changes.forget()
    assert changes.towards(snapshot(0.0, held_at=-1.0)) == [Attach(CUBE, LINK, "palm", at(1.0))]


def test_an_object_that_vanished_while_the_receiver_was_in_doubt_is_removed() -> None:
    changes = told(snapshot(0.0))
    changes.towards(snapshot(0.1))
    changes.forget()
    assert changes.towards(snapshot(None)) == [Remove(CUBE)]
    changes.confirm()
    assert changes.towards(snapshot(None)) == []
