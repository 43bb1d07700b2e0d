# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory of an episode does not depend on how often simulated time stood still."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import rospy
from control_msgs.msg import JointControllerState, JointTrajectoryControllerState
from predicate_worlds import sample, state
from sensor_msgs.msg import JointState

from modular_framework_benchmark.episodes.ros_recording import (
    count_missing_samples,
    periodic_joint_states,
    write_recording,
)
from modular_framework_benchmark.episodes.ros_samples import Samples
from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_benchmark.results.lerobot_frames import ACTION, read_frames

RATE = 50.0
NO_RECORD = {"samples": [], "boxes": {}, "robots": []}
STEP_S = 1.0 / 240.0


def states(times_s: list[float], names: tuple[str, ...] = ("pan",)) -> list[JointState]:
    messages = [JointState(name=list(names), position=[time_s] * len(names)) for time_s in times_s]
    for message, time_s in zip(messages, times_s, strict=True):
        message.header.stamp = rospy.Time.from_sec(time_s)
    return messages


def published(seconds: float) -> list[float]:
    """The physics steps in which a controller publishes: the first one in each turn."""
    turns = np.arange(0, round(seconds * RATE))
    return (np.ceil(turns / RATE / STEP_S - 1e-9) * STEP_S).tolist()


def test_states_of_moments_when_time_stood_still_are_left_out() -> None:
    in_turn = published(4.0)
    stood_still = [round(time_s / STEP_S) * STEP_S + 2 * STEP_S for time_s in (0.5, 0.52, 1.234, 3.0)]
    mixed = states(sorted(in_turn + stood_still))
    kept = periodic_joint_states(mixed, RATE)
    assert [state.position[0] for state in kept] == in_turn


def test_controllers_of_different_joints_have_a_state_each() -> None:
    times_s = published(1.0)
    mixed = [*states(times_s, ("pan",)), *states(times_s, ("finger", "thumb"))]
    assert len(periodic_joint_states(mixed, RATE)) == 2 * len(times_s)


def test_lost_states_are_counted() -> None:
    times_s = np.array(published(2.0))
    assert count_missing_samples(times_s, RATE) == 0
    assert count_missing_samples(np.delete(times_s, [10, 11, 40]), RATE) == 3
    assert count_missing_samples(times_s[:0], RATE) == 0


def test_poses_are_those_of_the_simulation_and_a_model_at_rest_has_one_row(tmp_path: Path) -> None:
    samples = Samples()
    samples.joints = states(published(0.4))
    moving = [sample(0.02 * number, {"cube": state((0, 0, 0.1 * number))}, None, None) for number in range(20)]
    moving[0] = sample(0.0, {"cube": state((0, 0, 0)), "table": state((1, 0, 0))}, [], [])
    world = {"samples": moving, "boxes": {}, "robots": []}
    answer = {"zero": 0.0, "simulated_s": 0.4, "checked_s": 0.3}
    written = write_recording(
        tmp_path,
        samples,
        world,
        spawned=(PlacedObject("cube", "cube", 0.0, 0.0, 0.0, scale=0.8),),
        answer=answer,
        rate_hz=RATE,
    )
    assert written["recording_fault"] == "" and written["final"]["cube"][2] == pytest.approx(1.5)
    recording = json.loads((tmp_path / "recording.json").read_text())
    assert recording["origin_s"] == 0.0
    assert recording["spawned"] == {"cube": "cube"} and recording["scales"] == {"cube": 0.8}
    objects = recording["objects"]
    assert objects["cube"]["time_s"] == pytest.approx([0.02 * number for number in range(20)])
    assert objects["cube"]["z"] == pytest.approx([0.1 * number for number in range(20)])
    assert objects["table"]["x"] == [1.0]


def test_the_action_of_a_learner_has_the_gripper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rospy, "get_time", lambda: 0.0)
    samples = Samples()
    samples.joints = states([0.1, 0.2, 0.3, 0.4], ("pan", "knuckle"))
    arm = JointTrajectoryControllerState(joint_names=["pan"])
    arm.header.stamp, arm.desired.positions, arm.actual.positions = rospy.Time.from_sec(0.1), [0.5], [0.5]
    samples.controllers = [("arm", arm)]
    close = JointControllerState(set_point=1.2)
    close.header.stamp = rospy.Time.from_sec(0.25)
    samples.set_points = [("knuckle", close)]
    answer = {"zero": 0.0, "simulated_s": 0.4}
    write_recording(tmp_path, samples, NO_RECORD, spawned=(), answer=answer, rate_hz=None)
    frames = read_frames(tmp_path / "trajectory.parquet", 10)
    gripper = frames.values[ACTION][:, frames.names[ACTION].index("knuckle")]
    assert gripper == pytest.approx([0.1, 0.2, 1.2, 1.2]), "the measured position before the first command"
    assert "pan" in frames.names[ACTION]


def test_a_place_that_cannot_be_planned_is_a_failed_plan_and_a_feasible_one_is_no_plan(tmp_path: Path) -> None:
    samples = Samples()
    samples.joints = states(published(0.4))
    report = {"kind": "place", "time": 0.2, "reason": "place 0: reach: out of reach", "error_code": -31}
    samples.planning = [(10.2, report), (10.3, {**report, "time": 0.3, "reason": "", "error_code": 1})]
    answer = {"zero": 0.0, "simulated_s": 0.4}
    write_recording(tmp_path, samples, NO_RECORD, spawned=(), answer=answer, rate_hz=RATE)
    (found,) = json.loads((tmp_path / "recording.json").read_text())["reports"]
    assert (found["component"], found["succeeded"], found["figures"]["error_code"]) == ("planning", False, -31)
