# SPDX-License-Identifier: BSD-3-Clause
"""Policies move the tip of an arm of fake hardware by displacements in a named frame."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import rospy
from std_msgs.msg import String
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from mbf_method.errors import MethodFault
from mbf_method.observation import Observation
from mbf_method.wire import PROTOCOL, VERSION, pack, unpack
from modular_framework_core.commander.robot_groups import read_group
from modular_framework_core.commander.ros_joint_monitor import JointMonitor
from modular_framework_ros.calls import wait_until
from modular_framework_states.policy_arm import PolicyArm
from modular_framework_states.states.run_policy import RunPolicy
from modular_framework_testing.control.ros_controllers import start_controllers

START = [3.1376, -1.6560, 1.3870, -1.2662, -1.5708, 0.0]
"""A posture far from singularities [rad]."""
STRETCHED = [0.0, -math.pi / 2, 0.0, -math.pi / 2, -1.0, 0.0]


class Robot:
    """Userdata and reports of a running arm, with forward kinematics of its own."""

    def __init__(self) -> None:
        urdf, srdf = (rospy.get_param(name) for name in ("robot_description", "robot_description_semantic"))
        limits = rospy.get_param("robot_description_planning/joint_limits")
        group = read_group(urdf, srdf, "arm", limits)
        self.joints = group.joint_names
        self._monitor = JointMonitor()
        self._monitor.connect()
        self.reports: list[dict[str, Any]] = []
        rospy.Subscriber("component_reports", String, lambda message: self.reports.append(json.loads(message.data)))
        self._commander = SimpleNamespace(group=group, positions_of=self._monitor.positions)
        self._model = pin.buildModelFromXML(urdf)
        self._arm = PolicyArm("arm/follow_joint_trajectory", self.joints, 0.5)
        self._arm.connect()
        assert wait_until(lambda: len(self._monitor.positions(self.joints)) == 6, 60.0)

    def move(self, positions: list[float]) -> None:
        self._arm.start(np.array([positions]))
        assert wait_until(self._arm.has_ended, 30.0)
        assert self._arm.fault() == ""

    def tip(self) -> pin.SE3:
        self._monitor.wait_for_rest(list(self.joints), lambda: False)
        data, configuration = self._model.createData(), pin.neutral(self._model)
        for name, position in self._monitor.positions(self.joints).items():
            configuration[self._model.joints[self._model.getJointId(name)].idx_q] = position
        pin.framesForwardKinematics(self._model, data, configuration)
        return data.oMf[self._model.getFrameId("ee_link")].copy()

    def run(self, state: RunPolicy) -> str:
        self.reports.clear()
        outcome = state.execute(SimpleNamespace(arm_commander=self._commander))
        assert wait_until(lambda: bool(self.reports), 10.0)
        return str(outcome)


@pytest.fixture(scope="module")
def robot(ros_session: Any) -> Robot:
    start_controllers(["joint_state_controller", "arm"])
    return Robot()


@contextmanager
def policy(actions_of: Callable[[Observation], np.ndarray]) -> Iterator[str]:
    """Serves a policy in this process; yields its address."""

    def handle(connection: ServerConnection) -> None:
        try:
            connection.send(pack({"protocol": PROTOCOL, "version": VERSION, "kind": "actions", "name": "tip"}))
            for data in connection:
                actions = actions_of(Observation.from_message(unpack(data)))
                timing = {"infer_ms": 1.0, "queue_ms": 0.0}
                connection.send(pack({"result": {"actions": actions}, "server_timing": timing}))
        except ConnectionClosed:
            pass

    with serve(handle, "127.0.0.1", 0, compression=None) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()


def state(address: str, **options: Any) -> RunPolicy:
    timing = {"rate": 20.0, "horizon": 4, "max_duration": 30.0, "must_finish": True}
    return RunPolicy(address=address, actions="end_effector_deltas", **{**timing, **options})


def test_a_policy_brings_the_tip_to_a_pose_that_it_observes(robot: Robot) -> None:
    robot.move(START)
    goal = robot.tip().translation + np.array([0.04, -0.03, 0.05])
    frames: set[tuple[str, str]] = set()

    def approach(observation: Observation) -> np.ndarray:
        frames.add((observation.actions.link, observation.actions.frame))
        assert observation.actions.names == ("x", "y", "z", "rx", "ry", "rz")
        left = goal - observation.end_effector[:3, 3]
        if np.linalg.norm(left) < 0.002:
            return np.zeros((0, 6))
        step = left / 4 * min(1.0, 0.02 / float(np.linalg.norm(left)))
        return np.tile([*step, 0.0, 0.0, 0.0], (4, 1))

    before = robot.tip()
    with policy(approach) as address:
        run = state(address)
        assert robot.run(run) == "success", run.reason
    after = robot.tip()
    assert after.translation == pytest.approx(goal, abs=0.003)
    assert after.rotation == pytest.approx(before.rotation, abs=0.01)
    assert frames == {("ee_link", "world")}
    assert robot.reports[0]["method"]["said_name"] == "tip"


def test_the_axes_of_the_tip_move_with_the_tip(robot: Robot) -> None:
    robot.move(START)
    before, turn = robot.tip(), np.array([0.0, 0.0, 0.01])

    def turning(observation: Observation) -> np.ndarray:
        return np.tile([0.0, 0.0, 0.0, *turn], (4 if observation.step < 12 else 0, 1))

    with policy(turning) as address:
        run = state(address, frame="ee_link")
        assert robot.run(run) == "success", run.reason
    after = robot.tip()
    assert after.translation == pytest.approx(before.translation, abs=0.003)
    assert after.rotation == pytest.approx(before.rotation @ pin.exp3(12 * turn), abs=0.01)


@pytest.mark.parametrize(
    ("start", "action", "reason"),
    [
        (STRETCHED, [0.0, 0.0, 0.3, 0.0, 0.0, 0.0], "actions[0] cannot be executed: "),
        (START, [0.0, 0.0, -0.3, 0.0, 0.0, 0.0], "the maximum velocity is"),
        (START, [0.0, 0.0, np.nan, 0.0, 0.0, 0.0], "actions[0] has a z that is not finite"),
        (START, [0.0, 0.0, 0.1], "of shape (4, 6): x, y, z, rx, ry, rz"),
    ],
    ids=["out of reach", "too fast", "NaN", "shape"],
)
def test_a_displacement_that_cannot_be_executed_ends_the_state_without_a_motion(
    robot: Robot, start: list[float], action: list[float], reason: str
) -> None:
    robot.move(start)
    before = robot.tip()
    with policy(lambda _: np.tile(action, (4, 1))) as address:
        run = state(address)
        assert robot.run(run) == "fail"
    assert reason in run.reason
    assert robot.reports[0]["figures"]["method_fault"] == MethodFault.INVALID_RESULT
    assert robot.tip().translation == pytest.approx(before.translation, abs=0.002)


def test_a_policy_that_hangs_leaves_the_arm_at_its_last_target(robot: Robot) -> None:
    robot.move(START)
    before, over = robot.tip(), threading.Event()

    def lift_and_hang(observation: Observation) -> np.ndarray:
        if observation.step:
            over.wait(30.0)
        return np.tile([0.0, 0.0, 0.005, 0.0, 0.0, 0.0], (4, 1))

    with policy(lift_and_hang) as address:
        run = state(address, time_limit=1.0)
        assert robot.run(run) == "fail"
        over.set()
    assert "no result within 1 s" in run.reason
    assert robot.tip().translation == pytest.approx(before.translation + np.array([0.0, 0.0, 0.02]), abs=0.002)


def test_an_unknown_frame_is_named_with_the_most_similar_link(robot: Robot) -> None:
    run = state("ws://127.0.0.1:1", frame="ee_lnk")
    assert robot.run(run) == "fail"
    assert "'ee_lnk' is neither the planning frame nor a link" in run.reason
    assert "did you mean 'ee_link'" in run.reason
