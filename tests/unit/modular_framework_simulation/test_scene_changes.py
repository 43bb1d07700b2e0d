# SPDX-License-Identifier: BSD-3-Clause
"""A planning scene gets what changed in the world, and nothing else."""

from __future__ import annotations

from modular_framework_simulation.gazebo_ros.scene_changes import Add, Attach, Detach, Move, Remove, SceneChanges
from modular_framework_simulation.loop.snapshots import HeldObject, LinkSnapshot, ModelSnapshot, WorldSnapshot
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Link

LINK = Link("link", Pose(), None, (), ())
CUBE = ("cube", "link")


def at(x: float) -> Pose:
    return Pose((x, 0.0, 0.0))


def snapshot(x: float | None = 0.0, held_at: float | None = None, instance: int = 1) -> WorldSnapshot:
    """The world with a cube at x, in the hand when the hand's position is given."""
    models = ()
    if x is not None:
        models = (ModelSnapshot("cube", instance, False, (LinkSnapshot(LINK, at(x)),)),)
    held = (HeldObject("cube", "palm", at(held_at)),) if held_at is not None else ()
    return WorldSnapshot(0.0, models, held)


def changes_after(*snapshots: WorldSnapshot) -> SceneChanges:
    changes = SceneChanges()
    for each in snapshots:
        changes.changes_towards(each)
        changes.confirm()
    return changes


def test_a_new_object_is_put_once() -> None:
    changes = SceneChanges()
    assert changes.changes_towards(snapshot(0.0)) == [Add(CUBE, LINK, at(0.0))]
    changes.confirm()
    assert changes.changes_towards(snapshot(0.0)) == []


def test_what_was_not_confirmed_is_reported_again() -> None:
    changes = SceneChanges()
    changes.changes_towards(snapshot(0.0))
    assert changes.changes_towards(snapshot(0.0)) == [Add(CUBE, LINK, at(0.0))]


def test_movements_count_from_one_millimetre_and_add_up() -> None:
    changes = changes_after(snapshot(0.0))
    assert changes.changes_towards(snapshot(0.0008)) == []
    changes.confirm()
    assert changes.changes_towards(snapshot(0.0016)) == [Move(CUBE, at(0.0016))]


def test_a_turn_of_a_hundredth_radian_counts() -> None:
    turned = Pose.from_xyz_rpy((0, 0, 0), (0, 0, 0.02))
    world = WorldSnapshot(0.0, (ModelSnapshot("cube", 1, False, (LinkSnapshot(LINK, turned),)),), ())
    assert changes_after(snapshot(0.0)).changes_towards(world) == [Move(CUBE, turned)]


def test_a_deleted_object_is_removed_and_one_spawned_again_is_replaced() -> None:
    assert changes_after(snapshot(0.0)).changes_towards(snapshot(None)) == [Remove(CUBE)]
    assert changes_after(snapshot(0.0)).changes_towards(snapshot(0.0, instance=2)) == [
        Remove(CUBE),
        Add(CUBE, LINK, at(0.0)),
    ]


def test_a_held_object_is_attached_and_may_travel_with_the_hand() -> None:
    changes = changes_after(snapshot(0.0))
    assert changes.changes_towards(snapshot(0.0, held_at=-1.0)) == [Attach(CUBE, LINK, "palm", at(1.0))]
    changes.confirm()
    assert changes.changes_towards(snapshot(0.5, held_at=-0.5)) == []


def test_slip_in_the_hand_is_reported() -> None:
    changes = changes_after(snapshot(0.0, held_at=-1.0))
    assert changes.changes_towards(snapshot(0.0, held_at=-1.002)) == [Attach(CUBE, LINK, "palm", at(1.002))]


def test_a_released_object_is_detached_and_put_where_it_is() -> None:
    changes = changes_after(snapshot(0.0, held_at=-1.0))
    assert changes.changes_towards(snapshot(0.3)) == [Detach(CUBE, "palm"), Add(CUBE, LINK, at(0.3))]


def test_a_held_object_that_is_deleted_is_detached_and_removed() -> None:
    assert changes_after(snapshot(0.0, held_at=-1.0)).changes_towards(snapshot(None)) == [
        Detach(CUBE, "palm"),
        Remove(CUBE),
    ]


BALL, TABLE = ("ball", "link"), ("table", "link")


def three(cube_at: float = 0.0, held_at: float | None = None) -> WorldSnapshot:
    """The world with a table, a ball and the cube."""
    models = tuple(
        ModelSnapshot(name, number, False, (LinkSnapshot(LINK, at(x)),))
        for number, (name, x) in enumerate((("table", 1.0), ("ball", 2.0), ("cube", cube_at)))
    )
    return WorldSnapshot(0.0, models, (HeldObject("cube", "palm", at(held_at)),) if held_at is not None else ())


def put_again(changes: SceneChanges, world: WorldSnapshot) -> set[tuple[str, str]]:
    """The objects that are sent, all of them as new ones."""
    found = changes.changes_towards(world)
    assert all(isinstance(change, Add | Attach) for change in found), found
    changes.confirm()
    return {change.key for change in found}


def test_a_receiver_that_was_started_again_gets_everything() -> None:
    changes = changes_after(snapshot(0.0, held_at=-1.0))
    assert changes.compare(set(), {}) == []
    assert changes.changes_towards(snapshot(0.0, held_at=-1.0)) == [Attach(CUBE, LINK, "palm", at(1.0))]
    changes = changes_after(three(held_at=-1.0))
    assert changes.compare(set(), {}) == []
    assert put_again(changes, three(held_at=-1.0)) == {TABLE, BALL, CUBE}


def test_a_scene_that_was_cleared_gets_everything_but_what_it_still_holds() -> None:
    changes = changes_after(three(held_at=-1.0))
    assert changes.compare({TABLE, BALL}, {CUBE: "palm"}) == []
    assert changes.changes_towards(three(held_at=-1.0)) == []
    assert changes.compare(set(), {CUBE: "palm"}) == []
    assert put_again(changes, three(held_at=-1.0)) == {TABLE, BALL}


def test_what_another_node_removes_by_name_stays_out_until_it_moves() -> None:
    changes = changes_after(three())
    assert changes.compare({TABLE, BALL}, {}) == [CUBE]
    assert changes.changes_towards(three()) == []
    assert changes.compare({TABLE, BALL}, {}) == [], "named once"
    assert changes.changes_towards(three(cube_at=0.1)) == [Add(CUBE, LINK, at(0.1))]


def test_objects_removed_one_by_one_come_back_when_none_is_left() -> None:
    changes = changes_after(three())
    assert changes.compare({TABLE, BALL}, {}) == [CUBE]
    assert changes.changes_towards(three()) == []
    assert changes.compare(set(), {}) == []
    assert put_again(changes, three()) == {TABLE, BALL, CUBE}


def test_a_new_object_does_not_hide_that_the_scene_was_cleared() -> None:
    changes = changes_after(snapshot(0.0))
    changes.compare({CUBE}, {})
    ball = ModelSnapshot("ball", 7, False, (LinkSnapshot(LINK, at(2.0)),))
    both = WorldSnapshot(0.0, (*snapshot(0.0).models, ball), ())
    changes.changes_towards(both)
    changes.confirm()
    assert changes.compare({BALL}, {}) == [], "the cube was cleared away before the ball came"
    assert put_again(changes, both) == {CUBE}


def test_what_another_node_attached_is_left_to_it_until_the_gripper_holds_it() -> None:
    changes = changes_after(three())
    assert changes.compare({TABLE, BALL}, {CUBE: "palm"}) == []
    assert changes.changes_towards(three(cube_at=0.2)) == []
    assert changes.changes_towards(three(cube_at=0.2, held_at=-1.0)) == [Attach(CUBE, LINK, "palm", at(1.2))]
    assert changes.compare({TABLE, BALL, CUBE}, {}) == []
    assert changes.changes_towards(three(cube_at=0.2)) == [Add(CUBE, LINK, at(0.2))], "put down by that node, somewhere"


def test_what_another_node_detached_stays_so_until_the_gripper_lets_it_go() -> None:
    changes = changes_after(three(held_at=-1.0))
    assert changes.compare({TABLE, BALL, CUBE}, {}) == []
    assert changes.changes_towards(three(held_at=-1.0)) == []
    assert changes.changes_towards(three(cube_at=0.3)) == [Add(CUBE, LINK, at(0.3))]


def test_an_object_that_vanished_while_the_receiver_was_away_is_removed() -> None:
    changes = changes_after(snapshot(0.0))
    changes.changes_towards(snapshot(0.1))
    assert changes.changes_towards(snapshot(None)) == [Remove(CUBE)]
    changes.confirm()
    assert changes.changes_towards(snapshot(None)) == []
