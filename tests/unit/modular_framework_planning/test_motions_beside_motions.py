# SPDX-License-Identifier: BSD-3-Clause
"""While one arm moves, what matters of the other arm is where it is, or where its own motion will bring it."""

from __future__ import annotations

import numpy as np
import pytest
from wide_robots import robot

from modular_framework_planning.planning_scene.planning_scene import PlanningScene, empty_scene
from modular_framework_planning.trajectory_execution.path_watch import PathWatch

JOINTS = {side: [f"{side}_{name}" for name in ("pan", "lift", "elbow", "roll")] for side in ("left", "right")}
INWARD = {"left": -0.6, "right": 0.6}  # pan at which an arm lies across the middle [rad]


def scene(left: float = 0.0, right: float = 0.0) -> PlanningScene:
    """The arms stretched out forward, each turned about its shoulder [rad]."""
    model = robot()
    return empty_scene(model, model.merge(model.default_positions(), {"left_pan": left, "right_pan": right}))


def turning(side: str, *pans: float, seen: PlanningScene | None = None, was_planned: bool = True) -> PathWatch:
    """An arm that turns from one pan to the next, a second each."""
    rows = np.zeros((len(pans), 4))
    rows[:, 0] = pans
    return PathWatch(JOINTS[side], np.arange(len(pans), dtype=float), rows, seen or scene(), was_planned=was_planned)


def test_an_arm_is_stopped_by_where_the_other_one_is_and_both_links_are_named() -> None:
    watch = turning("left", 0.0, INWARD["left"])
    assert watch.robot_collision(scene()) is None
    hit = watch.robot_collision(scene(right=INWARD["right"]))
    assert hit is not None and "link 'left_" in hit.describe() and "link 'right_" in hit.describe()


def test_two_motions_that_would_meet_are_found_before_either_is_there() -> None:
    left, right = (turning(side, 0.0, INWARD[side]) for side in ("left", "right"))
    assert left.robot_collision(scene(), [right]) is not None
    assert right.robot_collision(scene(), [left]) is not None
    outward = turning("right", 0.0, -INWARD["right"])
    assert left.robot_collision(scene(), [outward]) is None


def test_an_arm_may_pass_where_the_other_one_will_have_left_in_time() -> None:
    leaving = turning("right", INWARD["right"], 0.0)
    entering = turning("left", 0.0, 0.0, 0.0, INWARD["left"], seen=scene(right=INWARD["right"]))
    assert turning("left", 0.0, INWARD["left"]).robot_collision(scene(right=INWARD["right"])) is not None
    assert entering.robot_collision(scene(right=INWARD["right"]), [leaving], (-0.1, 0.0, 0.1)) is None
    too_late = turning("right", *[INWARD["right"]] * 4, 0.0)
    waiting = turning("left", 0.0, 0.0, 0.0, INWARD["left"])
    assert waiting.robot_collision(scene(right=INWARD["right"]), [too_late]) is not None


def test_what_the_other_arm_does_after_the_end_of_a_motion_counts_too() -> None:
    short, later = turning("left", 0.0, INWARD["left"]), turning("right", 0.0, 0.0, 0.0, INWARD["right"])
    assert short.robot_collision(scene(), [later]) is not None


def test_an_arm_that_is_late_is_met_where_one_in_time_is_not() -> None:
    begun = scene(right=INWARD["right"])
    leaving, near = turning("right", INWARD["right"], 0.0), turning("left", 0.0, 0.0, INWARD["left"])
    assert near.robot_collision(begun, [leaving]) is None
    assert near.robot_collision(begun, [leaving], (-2.0,)) is not None


def test_the_rest_of_the_other_motion_is_that_from_where_its_arm_was_seen() -> None:
    right = turning("right", INWARD["right"], 0.0, 0.0)
    assert right.positions_at(np.array([0.0, 1.0]))[:, 0] == pytest.approx([INWARD["right"], 0.0])
    right.advance(scene(right=0.3).positions)
    assert right.positions_at(np.array([0.0, 0.25]))[:, 0] == pytest.approx([0.3, 0.15], abs=0.02)


def test_a_contact_that_the_plan_accepted_does_not_stop_the_motion() -> None:
    crossed = scene(*INWARD.values())
    planned = turning("left", INWARD["left"], INWARD["left"] - 0.02, seen=crossed)
    assert planned.robot_collision(scene(INWARD["left"], INWARD["right"] + 0.02)) is None
    free = turning("left", INWARD["left"], INWARD["left"] - 0.02, seen=scene(left=INWARD["left"]))
    assert free.robot_collision(crossed) is not None


def test_of_a_path_that_was_not_planned_here_only_the_contacts_at_its_start_are_accepted() -> None:
    across = scene(right=INWARD["right"])
    planned = turning("left", 0.0, INWARD["left"], seen=across)
    unknown = turning("left", 0.0, INWARD["left"], seen=across, was_planned=False)
    assert planned.robot_collision(across) is None
    assert unknown.robot_collision(across) is not None
    touching = turning("left", INWARD["left"], INWARD["left"], seen=scene(*INWARD.values()), was_planned=False)
    assert touching.robot_collision(scene(*INWARD.values())) is None


def test_other_joints_count_as_moved_when_they_did_and_the_own_ones_do_not() -> None:
    watch = turning("left", 0.0, INWARD["left"])
    assert not watch.other_joints_moved(scene(left=-0.5).positions)
    assert not watch.other_joints_moved(scene(right=0.005).positions)
    assert watch.other_joints_moved(scene(right=0.05).positions)
    assert not watch.other_joints_moved(scene(right=0.05).positions)
    finger = robot().merge(scene(right=0.05).positions, {"left_finger": 0.03})
    assert watch.other_joints_moved(finger)


def test_a_motion_of_all_joints_has_nothing_beside_it() -> None:
    names = [name for name in robot().joint_names if name not in robot().document.mimics]
    watch = PathWatch(names, np.array([0.0, 1.0]), np.zeros((2, len(names))), scene())
    assert not watch.other_joints_moved(scene(left=0.5).positions)
    assert watch.robot_collision(scene()) is None
