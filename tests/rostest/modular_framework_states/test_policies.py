# SPDX-License-Identifier: BSD-3-Clause
"""Policies in their own process drive an arm and a gripper of fake hardware through the ordinary controllers."""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rospy
from control_msgs.msg import JointTrajectoryControllerState
from sensor_msgs.msg import Image
from std_msgs.msg import String
from websockets.sync.server import ServerConnection, serve

import smach
from mbf_method.errors import MethodFault
from mbf_method.wire import pack, unpack
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.metrics.failure_classes import FailureClass, failure_class
from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements
from modular_framework_benchmark.metrics.recording_files import reports_of
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.results.lerobot_dataset import LeRobotWriter
from modular_framework_benchmark.results.lerobot_frames import read_frames
from modular_framework_core.commander.robot_groups import read_group
from modular_framework_core.commander.ros_joint_monitor import JointMonitor
from modular_framework_core.msg import GraspAction
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.calls import wait_until
from modular_framework_states.policy_arm import PolicyArm
from modular_framework_states.states.run_policy import RunPolicy
from modular_framework_testing.control.ros_controllers import start_controllers

ROOT = Path(__file__).resolve().parents[3]
PYTHON = ["/usr/bin/env", f"PYTHONPATH={ROOT / 'src/mbf_method/src'}", sys.executable]
EXAMPLE = [*PYTHON, str(ROOT / "docs/examples/my_policy.py")]
FAULTY = ROOT / "tests/unit/mbf_method/faulty_policy.py"
CAMERA_TOPIC = "front/image_raw"
ARM = ("shoulder", "elbow")
REPLAY_RATE_HZ = 30


def faulty(fault: str) -> list[str]:
    return [sys.executable, str(FAULTY), fault]


class Robot:
    """Userdata and reports of a running arm."""

    def __init__(self) -> None:
        urdf, srdf = (rospy.get_param(name) for name in ("robot_description", "robot_description_semantic"))
        self._monitor = JointMonitor()
        self._monitor.connect()
        self.reports: list[dict[str, Any]] = []
        rospy.Subscriber("component_reports", String, lambda message: self.reports.append(json.loads(message.data)))
        self.commander = SimpleNamespace(group=read_group(urdf, srdf, "arm"), positions_of=self._monitor.positions)
        self.gripper = SteadyActionClient("moveit_grasp_action_server", GraspAction)
        self._arm = PolicyArm("arm/follow_joint_trajectory", ARM, 1.0)
        self._arm.connect()
        assert wait_until(lambda: len(self.positions()) == 3, 60.0)

    def positions(self) -> dict[str, float]:
        return self._monitor.positions(["shoulder", "elbow", "finger"])

    def move_to(self, positions: list[float]) -> None:
        self._arm.start(np.array([positions]))
        assert wait_until(self._arm.has_ended, 30.0) and self._arm.fault() == ""

    def comes_to_rest(self) -> bool:
        return self._monitor.wait_for_rest(["shoulder", "elbow"], lambda: False)

    def run(self, state: RunPolicy) -> str:
        machine = smach.StateMachine(outcomes=["success", "fail"])
        machine.userdata.arm_commander = self.commander
        machine.userdata.manipulator_controller_client = self.gripper
        machine.userdata.max_torque = 1.0
        self.reports.clear()
        with machine:
            smach.StateMachine.add("ONLY", state, transitions={})
        outcome = machine.execute()
        assert wait_until(lambda: bool(self.reports), 10.0)
        return str(outcome)


@pytest.fixture(scope="module")
def robot(ros_session: Any) -> Robot:
    start_controllers(["joint_state_controller", "arm", "gripper"])
    return Robot()


@pytest.fixture
def camera() -> Iterator[None]:
    publisher, over = rospy.Publisher(CAMERA_TOPIC, Image, queue_size=1), threading.Event()

    def publish() -> None:
        while not over.wait(0.05):
            image = Image(height=2, width=3, encoding="rgb8", step=9, data=bytes(range(18)))
            image.header.stamp = rospy.Time.now()
            publisher.publish(image)

    thread = threading.Thread(target=publish, daemon=True)
    thread.start()
    yield
    over.set()
    thread.join()


def test_the_example_drives_the_arm_to_its_goal_and_closes_the_gripper(robot: Robot, camera: None) -> None:
    state = RunPolicy(
        command=EXAMPLE,
        cameras={"front": CAMERA_TOPIC},
        gripper=["open", "closed"],
        rate=20.0,
        horizon=8,
        chunk=4,
        max_duration=60.0,
        must_finish=True,
    )
    assert robot.run(state) == "success", state.reason
    positions = robot.positions()
    assert positions["shoulder"] == pytest.approx(0.4, abs=0.01)
    assert positions["elbow"] == pytest.approx(-0.3, abs=0.01)
    assert positions["finger"] > 0.9 * 0.8
    (report,) = robot.reports
    figures = report["figures"]
    assert (report["component"], report["succeeded"]) == ("policy", True)
    assert figures["actions"] == 4 * figures["chunks"]
    assert figures["chunks"] == figures["queries"] - 1  # the last query is answered by the end of the task
    assert figures["clipped_actions"] == 0.0
    method = report["method"]
    assert (method["command"], method["address"], method["said_name"]) == (EXAMPLE, "", "reach")
    assert len(method["sources"]) == 64
    assert figures["method_time_s"] > 0.0 and figures["transport_time_s"] > 0.0


def test_a_policy_without_an_end_drives_for_its_duration(robot: Robot) -> None:
    before = robot.positions()
    state = RunPolicy(command=faulty("never ends"), rate=20.0, horizon=4, max_duration=1.0)
    assert robot.run(state) == "success", state.reason
    assert robot.positions()["shoulder"] > before["shoulder"] + 0.05
    state = RunPolicy(command=faulty("never ends"), rate=20.0, horizon=4, max_duration=0.5, must_finish=True)
    assert robot.run(state) == "fail"
    assert "the policy was not done within 0.5 s" in state.reason


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a policy: its kind, its class, its cause, and the time after which the state must have ended [s]."""

    kind: MethodFault
    failure: FailureClass
    cause: str
    limit_s: float


INVALID, TOO_LARGE = MethodFault.INVALID_RESULT, MethodFault.TOO_LARGE
LIMIT_S, SIZE_LIMIT, MARGIN_S = 1.0, 50_000, 15.0
"""Limits of the tests; the margin includes the start of the process and the motion of a chunk on a busy machine."""
FAULTS = {
    "exits": Fault(MethodFault.NOT_STARTED, FailureClass.DIED, "exited with code 3", MARGIN_S),
    "never listens": Fault(MethodFault.NOT_STARTED, FailureClass.DIED, "not ready within 1 s", LIMIT_S + MARGIN_S),
    "dies": Fault(MethodFault.DIED, FailureClass.DIED, "was ended by SIGKILL", MARGIN_S),
    "hangs": Fault(MethodFault.LATE, FailureClass.DIED, "no result within 1 s", LIMIT_S + MARGIN_S),
    "is late": Fault(MethodFault.LATE, FailureClass.DIED, "no result within 1 s", LIMIT_S + MARGIN_S),
    "raises": Fault(MethodFault.RAISED, FailureClass.INVALID_OUTPUT, "ValueError: no weights", MARGIN_S),
    "has too few columns": Fault(INVALID, FailureClass.INVALID_OUTPUT, "actions has shape (4, 1)", MARGIN_S),
    "has too few actions": Fault(INVALID, FailureClass.INVALID_OUTPUT, "actions has shape (3, 2)", MARGIN_S),
    "returns NaN": Fault(INVALID, FailureClass.INVALID_OUTPUT, "actions[1] has a shoulder that is not", MARGIN_S),
    "is twice too large": Fault(TOO_LARGE, FailureClass.INVALID_OUTPUT, "larger than 50000 bytes", MARGIN_S),
    "leaves the limits": Fault(INVALID, FailureClass.INVALID_OUTPUT, "to 100.0000; it must be from -2.0", MARGIN_S),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_ends_the_state_within_its_limit_with_its_class_and_cause_and_holds_the_arm(
    robot: Robot, name: str
) -> None:
    robot.move_to([0.0, 0.0])
    fault = FAULTS[name]
    start_limit_s = LIMIT_S if name == "never listens" else 60.0
    limits = {"start_limit": start_limit_s, "time_limit": LIMIT_S, "size_limit": SIZE_LIMIT}
    state = RunPolicy(command=faulty(name), rate=20.0, horizon=4, **limits)
    assert robot.run(state) == "fail"
    assert fault.cause in state.reason
    (report,) = robot.reports
    assert report["wall_s"] < fault.limit_s
    assert report["figures"]["method_fault"] == fault.kind
    assert failure_of(report) is fault.failure
    assert robot.comes_to_rest()
    start = robot.positions()
    assert not wait_until(lambda: abs(robot.positions()["shoulder"] - start["shoulder"]) > 1e-3, 0.5)


def failure_of(report: dict[str, Any]) -> FailureClass | None:
    """Returns the class of an episode whose task failed with a report."""
    entry = {**report, "started_s": report["started"], "ended_s": report["ended"], "wall_begin": 0.0, "motion": None}
    episode = EpisodeMeasurements(TaskSettings(), EpisodeStatus.FAILED, reports=reports_of({"reports": [entry]}))
    return failure_class(episode, task_succeeded=False)


def test_targets_outside_the_limits_are_clamped_on_request(robot: Robot) -> None:
    state = RunPolicy(command=faulty("leaves the limits"), rate=20.0, horizon=4, clamp=True, max_duration=10.0)
    assert robot.run(state) == "success", state.reason
    assert robot.positions()["shoulder"] <= 2.0
    assert robot.reports[0]["figures"]["clipped_actions"] > 0.0


def test_answers_that_take_longer_than_an_action_are_counted(robot: Robot) -> None:
    robot.move_to([0.0, 0.0])
    state = RunPolicy(command=faulty("is slow"), rate=5.0, horizon=4)
    assert robot.run(state) == "success", state.reason
    figures = robot.reports[0]["figures"]
    assert (figures["queries"], figures["late_answers"]) == (4.0, 2.0)
    assert figures["method_time_s"] > 0.6


@pytest.mark.parametrize("kind", ["velocities", "deltas"])
def test_an_openpi_server_drives_the_arm(robot: Robot, camera: None, kind: str) -> None:
    received: list[dict[str, Any]] = []

    def handle(connection: ServerConnection) -> None:
        connection.send(pack({"action_horizon": 4}))
        for data in connection:
            received.append(unpack(data))
            actions = np.tile([-0.4, 0.0] if kind == "velocities" else [-0.02, 0.0], (4, 1))
            connection.send(pack({"actions": actions, "server_timing": {"infer_ms": 1.0}}))

    before = robot.positions()
    with serve(handle, "127.0.0.1", 0, compression=None) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        state = RunPolicy(
            address=f"ws://127.0.0.1:{server.socket.getsockname()[1]}",
            openpi_keys={"positions": "observation/state", "front": "observation/image", "prompt": "prompt"},
            cameras={"front": CAMERA_TOPIC},
            prompt="lower the arm",
            actions=kind,
            rate=20.0,
            horizon=4,
            max_duration=1.5,
        )
        assert robot.run(state) == "success", state.reason
        server.shutdown()
    actions = robot.reports[0]["figures"]["actions"]
    assert before["shoulder"] - robot.positions()["shoulder"] == pytest.approx(0.02 * actions, abs=0.01)
    assert (received[0]["prompt"], received[0]["observation/image"].shape) == ("lower the arm", (2, 3, 3))
    assert received[0]["observation/state"].tolist() == pytest.approx([before["shoulder"], before["elbow"]], abs=0.01)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"command": EXAMPLE, "joints": ["wrist"]}, "has no active joint 'wrist'"),
        ({"command": EXAMPLE, "cameras": {"side": "no/camera"}, "camera_timeout": 0.5}, "camera 'side': no message"),
        ({"command": EXAMPLE, "gripper": ["open", "ajar"]}, "has no state 'ajar'"),
    ],
)
def test_a_missing_joint_camera_or_posture_is_named(robot: Robot, options: dict[str, Any], reason: str) -> None:
    state = RunPolicy(**options)
    assert robot.run(state) == "fail"
    assert reason in state.reason


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({}, "give either command, address or dataset"),
        ({"command": EXAMPLE, "openpi_keys": {"prompt": "prompt"}}, "openpi_keys needs the address"),
        ({"address": "ws://127.0.0.1:1", "openpi_keys": {"side": "image"}}, "openpi_keys names ['side']"),
        ({"command": EXAMPLE, "gripper": ["open"]}, "gripper has 1 items"),
        ({"command": EXAMPLE, "frame": "palm"}, "frame needs the actions end_effector_deltas"),
        ({"command": EXAMPLE, "dataset": "picks"}, "give either command, address or dataset"),
        ({"dataset": "picks", "actions": "deltas"}, "dataset needs the actions positions; actions is deltas"),
        (
            {"command": EXAMPLE, "actions": "end_effector_deltas", "joints": ["elbow"]},
            "end_effector_deltas moves all joints of the planning group; remove joints",
        ),
        ({"command": EXAMPLE, "horizon": 2, "chunk": 3}, "chunk is 3; it must be at most the horizon, 2"),
    ],
)
def test_options_that_exclude_each_other_are_refused(options: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError) as refused:
        RunPolicy(**options)
    assert reason in str(refused.value)


def test_an_exported_episode_is_replayed_to_the_same_joint_positions(robot: Robot, tmp_path: Path) -> None:
    robot.move_to([0.0, 0.0])
    samples: list[JointTrajectoryControllerState] = []
    recorder = rospy.Subscriber("arm/state", JointTrajectoryControllerState, samples.append)
    assert wait_until(lambda: bool(samples), 10.0)
    assert robot.run(RunPolicy(command=EXAMPLE, rate=20.0, horizon=8, chunk=4, must_finish=True)) == "success"
    assert robot.comes_to_rest()
    recorder.unregister()
    recorded = robot.positions()
    assert recorded["shoulder"] == pytest.approx(0.4, abs=0.01)

    export_motion(samples, tmp_path / "dataset")
    robot.move_to([0.0, 0.0])
    state = RunPolicy(dataset=str(tmp_path / "dataset"), rate=REPLAY_RATE_HZ, horizon=10, must_finish=True)
    assert robot.run(state) == "success", state.reason
    assert robot.comes_to_rest()
    replayed = robot.positions()
    assert [replayed[name] for name in ARM] == pytest.approx([recorded[name] for name in ARM], abs=0.005)
    (report,) = robot.reports
    assert report["method"]["address"] == "episode 0 of dataset dataset" and len(report["method"]["sources"]) == 64

    state = RunPolicy(dataset=str(tmp_path / "dataset"), rate=10.0, horizon=10)
    assert robot.run(state) == "fail"
    assert "it has 30 actions per second, the task 10; set rate" in state.reason
    assert robot.reports[0]["figures"]["method_fault"] == MethodFault.INVALID_RESULT


def export_motion(samples: list[JointTrajectoryControllerState], folder: Path) -> None:
    """Exports a motion as `export --lerobot` does, from the file that the recording of an episode contains."""
    columns = {"time_s": [sample.header.stamp.to_sec() for sample in samples]}
    for index, name in enumerate(samples[0].joint_names):
        columns[f"{name}/position"] = [sample.actual.positions[index] for sample in samples]
        columns[f"{name}/command"] = [sample.desired.positions[index] for sample in samples]
    folder.mkdir()
    pd.DataFrame(columns).drop_duplicates("time_s").to_parquet(folder / "trajectory.parquet")
    writer = LeRobotWriter(folder, REPLAY_RATE_HZ, "r", dict.fromkeys(ARM, "rad"))
    writer.add(read_frames(folder / "trajectory.parquet", REPLAY_RATE_HZ), {}, "reach", succeeded=True)
    writer.close()
