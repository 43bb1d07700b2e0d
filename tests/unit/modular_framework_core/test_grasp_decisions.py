# SPDX-License-Identifier: BSD-3-Clause
"""The grasp server's checks of commands, and its decision whether a stage was reached."""

from __future__ import annotations

import pytest

from modular_framework_core.commander.robot_groups import RobotModelError, read_group
from modular_framework_core.grasping.grasp_server import (
    GraspCommandError,
    Outcome,
    Stage,
    closed_positions,
    effort_limits,
    judge,
    posture_targets,
    reached_tolerance,
    refuse_no_effort,
    torque_intensities,
    torque_share,
)
from modular_framework_core.grasping.stall_evidence import CommandedMotion, StallEvidence

URDF = """<robot name="r"><link name="base"/><link name="l1"/><link name="l2"/>
<link name="palm"/><link name="f1"/><link name="f2"/>
<joint name="a" type="revolute"><parent link="base"/><child link="l1"/><limit lower="-3" upper="3" effort="10"/></joint>
<joint name="b" type="continuous"><parent link="l1"/><child link="l2"/></joint>
<joint name="mount" type="fixed"><parent link="l2"/><child link="palm"/></joint>
<joint name="f" type="revolute"><parent link="palm"/><child link="f1"/>
<limit lower="0" upper="1.94" effort="2"/></joint>
<joint name="g" type="revolute"><parent link="palm"/><child link="f2"/>
<limit lower="0" upper="1.94"/><mimic joint="f"/></joint>
</robot>"""
SRDF = """<robot name="r"><group name="arm"><chain base_link="base" tip_link="palm"/></group>
<group name="hand"><joint name="f"/><joint name="g"/></group>
<group name="all"><group name="arm"/><group name="hand"/></group>
<group name="odd"><joint name="zz"/></group><group name="loop"><group name="loop"/></group>
<group_state name="closed" group="hand"><joint name="f" value="1.9"/></group_state></robot>"""
HAND = read_group(URDF, SRDF, "hand")
CLOSED = closed_positions(HAND)


def test_groups_hold_their_active_joints_in_order_and_know_their_tip() -> None:
    arm = read_group(URDF, SRDF, "arm")
    assert arm.joint_names == ("a", "b")
    assert arm.tip_link == "palm"
    assert read_group(URDF, SRDF, "all").joint_names == ("a", "b", "f")
    assert HAND.joint_names == ("f",)
    assert CLOSED == {"f": 1.9}
    assert arm.joint("b").upper == float("inf")


@pytest.mark.parametrize(
    ("group", "hint"), [("nothing", "no group 'nothing'.*arm"), ("odd", "zz"), ("loop", "contains itself")]
)
def test_a_wrong_group_is_named(group: str, hint: str) -> None:
    with pytest.raises(RobotModelError, match=hint):
        read_group(URDF, SRDF, group)


def test_a_description_that_is_no_xml_is_named() -> None:
    with pytest.raises(RobotModelError, match="URDF"):
        read_group("<robot", SRDF, "arm")
    with pytest.raises(RobotModelError, match="'moon' is not below link 'base'"):
        read_group(URDF, SRDF.replace('tip_link="palm"', 'tip_link="moon"'), "arm")


@pytest.mark.parametrize(
    ("names", "positions", "hint"),
    [
        ([], [], "at least one"),
        (["f"], [], "must be equal"),
        (["f", "f"], [0.1, 0.1], "twice"),
        (["a"], [0.1], "no active joint"),
        (["g"], [0.1], "no active joint"),
        (["f"], [2.5], "the target is 2.5; allowed"),
        (["f"], [float("nan")], "the target is nan"),
    ],
)
def test_a_posture_that_does_not_fit_the_hand_is_refused(names: list[str], positions: list[float], hint: str) -> None:
    with pytest.raises(GraspCommandError, match=hint):
        posture_targets(names, positions, HAND)


def test_effort_is_a_fraction_of_the_effort_limit() -> None:
    assert effort_limits({"f": 1.0}, {"f": -0.5}, HAND, 0.5, Stage.PREGRASP) == {"f": pytest.approx(0.5)}
    assert effort_limits({"f": 1.0}, {}, HAND, 1.0, Stage.GRASP) == {"f": 2.0}


def test_no_torque_differs_from_the_default_torque_of_the_controller() -> None:
    arm = read_group(URDF, SRDF, "arm")
    assert effort_limits({"f": 1.0}, {"f": 0.0}, HAND, 1.0, Stage.GRASP) == {"f": 0.0}
    assert effort_limits({"a": 1.0}, {}, arm, 0.5, Stage.GRASP) == {"a": 5.0}
    assert effort_limits({"b": 1.0}, {}, arm, 0.5, Stage.GRASP) == {}
    assert effort_limits({"b": 1.0}, {"b": 0.0}, arm, 0.5, Stage.GRASP) == {"b": 0.0}
    with pytest.raises(GraspCommandError, match="joint 'f' has an effort limit of 0"):
        refuse_no_effort("f", 0.0)


@pytest.mark.parametrize("stage", [Stage.PREGRASP, Stage.POSTGRASP])
def test_no_torque_for_a_posture_is_the_torque_of_the_controller(stage: Stage) -> None:
    assert effort_limits({"f": 1.0}, {"f": 0.0}, HAND, 1.0, stage) == {}


def test_the_maximum_torque_is_a_fraction_of_the_full_torque() -> None:
    assert (torque_share(400.0, 800.0), torque_share(900.0, 800.0)) == (0.5, 1.0)


@pytest.mark.parametrize("torque", [0.0, -1.0, float("nan"), float("inf"), float("-inf")])
def test_a_maximum_torque_that_is_not_positive_is_refused(torque: float) -> None:
    with pytest.raises(GraspCommandError, match=f"max_torque is {torque}; allowed: numbers above 0"):
        torque_share(torque, 800.0)


@pytest.mark.parametrize(
    ("names", "values", "hint"),
    [
        (["f"], [1.0, 1.0], "1 joint names and 2 values"),
        ([], [1.0], "0 joint names and 1 values"),
        (["f", "f"], [1.0, 1.0], "twice"),
        (["x"], [1.0], "no active joint"),
        (["f"], [1.5], "is 1.5; allowed: -1 to 1"),
        (["f"], [float("nan")], "is nan; allowed: -1 to 1"),
        (["f"], [float("inf")], "is inf"),
    ],
)
def test_invalid_torque_intensities_are_refused(names: list[str], values: list[float], hint: str) -> None:
    with pytest.raises(GraspCommandError, match=hint):
        torque_intensities(names, values, HAND)


def test_torque_intensities_are_reported_by_joint_and_none_are_none() -> None:
    assert torque_intensities(["f"], [-0.5], HAND) == {"f": -0.5}
    assert torque_intensities([], [], HAND) == {}
    assert torque_intensities(["f"], [], HAND) == {}


STALL = Outcome({"f": 0.4}, True, "so said the controller")


def close(begun: dict[str, float], effort: float | None = 0.5) -> CommandedMotion:
    return CommandedMotion(begun, {"f": 1.94}, {} if effort is None else {"f": effort})


def held_at(position: float) -> StallEvidence:
    evidence = StallEvidence(0.05)
    assert evidence.judge(Outcome({"f": position}, True, pressing=True), close({"f": position})).stalled
    return evidence


@pytest.mark.parametrize(
    ("outcome", "begun", "evidence"),
    [
        (STALL, 0.38, StallEvidence(0.05)),
        (Outcome({"f": 0.4}, True, pressing=True), 0.4, StallEvidence(0.05)),
        (STALL, 0.4, held_at(0.41)),
    ],
)
def test_fingers_that_moved_or_press_or_go_on_holding_were_stopped_by_something(
    outcome: Outcome, begun: float, evidence: StallEvidence
) -> None:
    assert evidence.judge(outcome, close({"f": begun})) is outcome


@pytest.mark.parametrize(
    ("begun", "evidence"),
    [
        ({"f": 0.4}, StallEvidence(0.05)),
        ({"f": 0.395}, StallEvidence(0.05)),
        ({"f": 0.8}, StallEvidence(0.05)),
        ({}, StallEvidence(0.05)),
        ({"f": 0.4}, held_at(0.6)),
        ({}, held_at(0.4)),
    ],
)
def test_fingers_that_never_moved_hold_nothing(begun: dict[str, float], evidence: StallEvidence) -> None:
    outcome = evidence.judge(STALL, close(begun))
    verdict = judge(Stage.GRASP, {"f": 1.94}, outcome, CLOSED, 0.05)
    assert not verdict.reached
    assert "have not moved" in verdict.reason and "so said the controller" in verdict.reason


@pytest.mark.parametrize(
    ("earlier", "effort", "stopped"),
    [
        (CommandedMotion({"f": 0.0}, {"f": 0.4}, {"f": 0.5}), 0.5, True),
        (CommandedMotion({"f": 0.0}, {"f": 0.4}, {"f": 0.5}), None, True),
        (CommandedMotion({"f": 0.0}, {"f": 0.4}, {"f": 0.5}), 0.4, False),  # less than what moved them
        (CommandedMotion({"f": 0.0}, {"f": 0.4}, {}), 0.5, False),  # moved by whatever the controller gave
        (CommandedMotion({"f": 0.9}, {"f": 0.4}, {"f": 0.5}), 0.5, False),  # moved the other way
        (CommandedMotion({"f": 0.399}, {"f": 0.4}, {"f": 0.5}), 0.5, False),
    ],
)
def test_fingers_that_touch_an_object_from_the_beginning_grasp_it_with_a_torque_that_moved_them(
    earlier: CommandedMotion, effort: float | None, stopped: bool
) -> None:
    evidence = StallEvidence(0.05)
    evidence.judge(Outcome({"f": 0.4}, False), earlier)
    assert evidence.judge(STALL, close({"f": 0.4}, effort)).stalled is stopped


def test_of_several_joints_one_that_is_short_of_its_target_must_have_moved() -> None:
    outcome, targets = Outcome({"f": 0.4, "h": 1.0}, True), {"f": 1.9, "h": 1.0}
    for begun, stopped in (({"f": 0.4, "h": 0.0}, False), ({"f": 0.1, "h": 1.0}, True)):
        assert StallEvidence(0.05).judge(outcome, CommandedMotion(begun, targets, {})).stalled is stopped


@pytest.mark.parametrize(
    ("stage", "target", "position", "stalled", "reached", "why"),
    [
        (Stage.PREGRASP, 0.5, 0.51, False, True, "reached"),
        (Stage.PREGRASP, 0.0, 0.4, False, False, "'f' is 0.4"),
        (Stage.PREGRASP, 0.5, 0.9, True, False, "away"),
        (Stage.GRASP, 1.94, 1.2, True, True, "stopped at an object"),
        (Stage.GRASP, 1.94, 1.93, False, False, "without an object"),
        (Stage.GRASP, 1.94, 1.92, True, False, "without an object"),
        (Stage.GRASP, 1.2, 1.21, False, True, "reached"),
        (Stage.GRASP, 1.94, 1.2, False, False, "away"),
        (Stage.POSTGRASP, 1.94, 1.2, True, True, "still"),
        (Stage.POSTGRASP, 1.2, 1.2, False, True, "reached"),
        (Stage.POSTGRASP, 1.94, 0.3, False, False, "away"),
    ],
)
def test_a_stage_is_reached_only_when_the_fingers_say_so(
    stage: Stage, target: float, position: float, stalled: bool, reached: bool, why: str
) -> None:
    verdict = judge(stage, {"f": target}, Outcome({"f": position}, stalled), CLOSED, 0.05)
    assert verdict.reached is reached
    assert why in verdict.reason


def test_joints_are_compared_by_name_not_by_sorted_values() -> None:
    verdict = judge(Stage.PREGRASP, {"f": 0.0, "h": 1.0}, Outcome({"f": 1.0, "h": 0.0}, False), {}, 0.05)
    assert not verdict.reached


def test_an_unknown_stage_is_refused() -> None:
    with pytest.raises(GraspCommandError, match="POST_GRASP_STATE=2"):
        Stage.of(3)


@pytest.mark.parametrize(("kind", "upper", "tolerance"), [("revolute", 1.94, 0.0485), ("prismatic", 0.04, 0.001)])
def test_what_counts_as_reached_is_a_share_of_the_fingers_range(kind: str, upper: float, tolerance: float) -> None:
    urdf = URDF.replace('<joint name="f" type="revolute">', f'<joint name="f" type="{kind}">').replace(
        "1.94", str(upper)
    )
    assert reached_tolerance(read_group(urdf, SRDF, "hand")) == pytest.approx(tolerance)
    assert reached_tolerance(read_group(URDF, SRDF, "arm")) == 0.05
