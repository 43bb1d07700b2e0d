# SPDX-License-Identifier: BSD-3-Clause
"""A plan from a stage of a grasp starts at the joint positions at which a plan to that stage ends."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_states.grasp_stages import StageError, arrival_fingers, near_joints, stage_joints

TURN = 6.0


class Arm:
    """One joint with a solution every turn, as far as it reaches."""

    def __init__(self, position: float, reach: float = 100.0) -> None:
        self.position, self.reach = position, reach
        self.seeds: list[dict[str, float]] = []

    def current_joints(self) -> dict[str, float]:
        return {"j": self.position}

    def solve_ik(self, pose, seed=None):
        self.seeds.append(dict(seed))
        if abs(pose.x) > self.reach:
            return Unreachable()
        turns = round((seed["j"] - pose.x) / TURN)
        return SimpleNamespace(joints={"j": pose.x + turns * TURN}, reason="")


class Unreachable:
    """No solution."""

    joints: dict[str, float] = {}
    reason = "the pose is out of reach"

    def __bool__(self) -> bool:
        return False


def grasp(*xs: float):
    stages = {}
    for name, x in zip(("pregrasp", "grasp", "postgrasp"), xs, strict=True):
        posture = SimpleNamespace(name=["f"], position=[0.4 if name == "pregrasp" else 1.9])
        stages[name] = SimpleNamespace(
            pose=SimpleNamespace(header=SimpleNamespace(frame_id="world"), x=x), posture=posture
        )
    return SimpleNamespace(grasp_id="g", **stages)


positions = st.floats(-20, 20)


@given(positions, positions, positions, positions)
def test_a_chain_walked_alone_ends_where_plans_made_one_after_the_other_end(now, first, second, third) -> None:
    message = grasp(first, second, third)
    one_by_one = Arm(now).current_joints() | arrival_fingers(message)
    for stage in ("pregrasp", "grasp", "postgrasp"):
        one_by_one = one_by_one | near_joints(Arm(now), message, stage, one_by_one)
        assert stage_joints(Arm(now), message, stage) == {"j": one_by_one["j"]}


def test_the_fingers_of_the_chain_are_those_of_the_pregrasp_posture() -> None:
    arm = Arm(0.0)
    stage_joints(arm, grasp(1.0, 2.0, 3.0), "postgrasp")
    assert [seed["f"] for seed in arm.seeds] == [0.4, 0.4, 0.4]


def test_a_stage_that_cannot_be_reached_is_named_with_the_reason() -> None:
    with pytest.raises(StageError, match="grasp pose of grasp 'g'.*out of reach"):
        stage_joints(Arm(0.0, reach=5.0), grasp(1.0, 50.0, 1.0), "postgrasp")


def test_a_stage_without_a_pose_is_named() -> None:
    message = grasp(1.0, 2.0, 3.0)
    message.grasp.pose.header.frame_id = ""
    with pytest.raises(StageError, match="the grasp of grasp 'g' has no pose"):
        stage_joints(Arm(0.0), message, "grasp")
