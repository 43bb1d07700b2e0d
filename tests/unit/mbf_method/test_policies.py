# SPDX-License-Identifier: BSD-3-Clause
"""Policies: actions and their limits, faults of the process, and servers that speak openpi's protocol."""

from __future__ import annotations

import re
import runpy
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from mbf_method import Actions, Observation, policy, task_done
from mbf_method.actions import checked_actions, limited_targets
from mbf_method.errors import (
    InvalidOutputError,
    MethodDiedError,
    MethodError,
    MethodLateError,
    MethodRaisedError,
    MethodStartError,
    MethodVersionError,
    TooLargeError,
)
from mbf_method.method_checks import check_policy, local_call
from mbf_method.method_client import MethodClient, MethodLimits, MethodSource
from mbf_method.observation import END_EFFECTOR_COLUMNS
from mbf_method.openpi import openpi_request
from mbf_method.sample_inputs import observations
from mbf_method.served_method import ACTIONS
from mbf_method.templates.policy import new_method as good_policy
from mbf_method.wire import OPENPI, pack, unpack

FAULTY_POLICY = str(Path(__file__).parent / "faulty_policy.py")
EXAMPLE = Path(__file__).parents[3] / "docs/examples/my_policy.py"
FIRST, LATER = observations()
SPEC = FIRST.actions
START = np.array([*FIRST.robot.positions, 0.0])
GOOD = np.tile(START, (SPEC.horizon, 1))


def changed(row: int, column: int, value: float) -> np.ndarray:
    actions = GOOD.copy()
    actions[row, column] = value
    return actions


@contextmanager
def started(fault: str, **limits: float) -> Iterator[MethodClient]:
    """Yields a client of a policy that has a fault from its second call."""
    source = MethodSource(command=(sys.executable, FAULTY_POLICY, fault))
    client = MethodClient(source, ACTIONS, MethodLimits(**limits))
    try:
        yield client
    finally:
        client.close()


def test_an_observation_survives_its_encoding() -> None:
    decoded = Observation.from_message(unpack(pack(FIRST)))
    assert pack(decoded) == pack(FIRST)
    assert decoded.actions.joint_names == ("joint_1", "joint_2", "joint_3")
    assert decoded.cameras["top"].colour.shape == (*decoded.cameras["top"].depth.shape, 3)


def test_no_action_means_that_the_task_is_done() -> None:
    assert len(checked_actions(unpack(pack(task_done(FIRST))), SPEC)) == 0


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ({}, r"the result has the fields \[\]; it must have \['actions'\]"),
        ({"actions": GOOD.tolist()}, r"actions is a list; it must be an array of numbers of shape \(8, 4\)"),
        ({"actions": GOOD[:, :3]}, r"actions has shape \(8, 3\)"),
        ({"actions": GOOD[:5]}, r"actions has shape \(5, 4\)"),
        ({"actions": GOOD[0]}, r"actions has shape \(4,\)"),
        ({"actions": GOOD.astype(str)}, r"type <U"),
        ({"actions": changed(2, 1, np.nan)}, r"actions\[2\] has a joint_2 that is not finite"),
        ({"actions": changed(0, 3, np.inf)}, r"actions\[0\] has a gripper that is not finite"),
    ],
)
def test_invalid_actions_are_refused(message: Mapping[str, Any], fault: str) -> None:
    with pytest.raises(InvalidOutputError, match=fault):
        checked_actions(message, SPEC)


@pytest.mark.parametrize(
    ("kind", "action"),
    [("positions", [-1.1, 0.4, 0.4, 1.0]), ("velocities", [1, 1, 1, 1]), ("deltas", [0.1] * 3 + [1])],
)
def test_positions_velocities_and_deltas_become_the_same_targets(kind: str, action: list[float]) -> None:
    targets = limited_targets(np.array([action], float), replace(SPEC, kind=kind), START)
    assert targets.fault == ""
    assert targets.values[0] == pytest.approx([-1.1, 0.4, 0.4, 1.0])


def test_deltas_add_up_from_target_to_target() -> None:
    targets = limited_targets(np.full((3, 4), 0.1), replace(SPEC, kind="deltas"), START)
    assert targets.values[:, 0] == pytest.approx([-1.1, -1.0, -0.9])
    assert targets.values[:, 3] == pytest.approx([0.1, 0.1, 0.1])


@pytest.mark.parametrize(
    ("start", "action", "fault", "limited"),
    [
        ([2.45, 0, 0, 0], [2.6, 0, 0, 0], r"actions\[0\] moves joint_1 to 2.6000; it must be from -2.5000 to 2.5", 2.5),
        (
            [0, 0, 0, 0],
            [0.5, 0, 0, 0],
            r"joint_1 from 0.0000 to 0.5000 at 5.0000 per s; the maximum velocity is 2",
            0.2,
        ),
        ([0, 0, 0, 0], [0, 0, 0, 1.5], r"moves gripper to 1.5000; it must be from 0.0000 to 1.0000", 0.0),
    ],
)
def test_a_target_outside_the_limits_has_a_reason_and_is_clamped(
    start: list[float], action: list[float], fault: str, limited: float
) -> None:
    targets = limited_targets(np.array([action], float), SPEC, np.array(start, float))
    assert re.search(fault, targets.fault)
    assert targets.values[0, 0] == pytest.approx(limited)
    assert targets.values[0, 3] <= 1.0
    assert targets.clipped.tolist() == [True]


def test_only_the_actions_that_exceed_a_limit_count_as_clipped() -> None:
    actions = np.array([[0.1, 0, 0, 0], [0.6, 0, 0, 0], [0.3, 0, 0, 0.5]], float)
    targets = limited_targets(actions, SPEC, np.zeros(4))
    assert targets.clipped.tolist() == [False, True, False]
    assert targets.values[:, 0] == pytest.approx([0.1, 0.3, 0.3])


ACCELERATING = replace(SPEC, max_acceleration=np.array([10.0, 10.0, 10.0, np.inf]))


@pytest.mark.parametrize(
    ("before", "position", "fault", "limited"),
    [
        (0.0, 0.1, "", 0.1),
        (0.0, 0.15, r"from 0.0000 to 0.1500 with 15.0000 per s\^2; the maximum acceleration is 10.0000 per s\^2", 0.1),
        (-0.1, 0.2, "", 0.2),
        (-0.2, 0.05, r"with 15.0000 per s\^2", 0.1),
        (-0.1, 0.25, "at 2.5000 per s; the maximum velocity is 2", 0.2),
    ],
)
def test_the_acceleration_between_successive_targets_is_limited(
    before: float, position: float, fault: str, limited: float
) -> None:
    actions, zeros = np.array([[position, 0.0, 0.0, 0.0]]), np.zeros(4)
    targets = limited_targets(actions, ACCELERATING, zeros, np.array([before, 0.0, 0.0, 0.0]))
    assert bool(targets.fault) == bool(fault) and re.search(fault, targets.fault)
    assert targets.values[0, 0] == pytest.approx(limited)


def test_a_start_at_rest_has_no_velocity() -> None:
    actions = np.array([[0.1, 0.0, 0.0, 0.0], [0.3, 0.0, 0.0, 0.0], [0.3, 0.0, 0.0, 0.0]])
    targets = limited_targets(actions, ACCELERATING, np.zeros(4))
    assert targets.clipped.tolist() == [False, False, True]
    assert targets.values[:, 0] == pytest.approx([0.1, 0.3, 0.4])


TIP_SPEC = replace(
    SPEC, kind="end_effector_deltas", names=(*END_EFFECTOR_COLUMNS, "gripper"), link="tool", frame="base"
)
TIP_OBSERVATION = replace(FIRST, actions=TIP_SPEC, end_effector=np.eye(4))


def test_an_observation_of_an_end_effector_survives_its_encoding() -> None:
    decoded = Observation.from_message(unpack(pack(TIP_OBSERVATION)))
    assert (decoded.actions.link, decoded.actions.frame, decoded.actions.joint_names) == ("tool", "base", ())
    assert decoded.end_effector.tolist() == np.eye(4).tolist()


@pytest.mark.parametrize(
    ("action", "fault"),
    [
        ([0.005, 0.0, 0.0, 0.0, 0.0, 0.05, 1.0], ""),
        ([5.0, 0.0, 0.0, 0.0, 0.0, 0.05, 1.0], "moves the end effector at 50 m/s; the columns must be in m"),
        ([0.005, 0.0, 0.0, 0.0, 0.0, 3.0, 1.0], "turns the end effector at 30 rad/s; the columns must be in rad"),
    ],
)
def test_wrong_units_of_end_effector_deltas_are_named(action: list[float], fault: str) -> None:
    moved = policy(lambda observation: Actions(np.tile(action, (SPEC.horizon, 1))))
    findings = check_policy(local_call(moved), [TIP_OBSERVATION])
    assert [text for text in findings.faults if fault in text] == list(findings.faults)
    assert bool(findings.faults) == bool(fault)


@pytest.mark.parametrize(
    ("fault", "error", "cause"),
    [
        ("dies", MethodDiedError, "was ended by SIGKILL"),
        ("hangs", MethodLateError, "no result within 1 s"),
        ("raises", MethodRaisedError, "ValueError: no weights"),
        ("is too large", TooLargeError, "larger than 100000 bytes"),
        ("returns NaN", InvalidOutputError, r"actions\[1\] has a joint_1 that is not finite"),
        ("has too few columns", InvalidOutputError, r"actions has shape \(8, 3\)"),
        ("has too few actions", InvalidOutputError, r"actions has shape \(7, 4\)"),
    ],
)
def test_each_fault_of_a_policy_has_its_class_and_cause(fault: str, error: type[MethodError], cause: str) -> None:
    with started(fault, call_s=1.0, result_bytes=100_000) as client:
        client.start()
        assert len(checked_actions(client.call(FIRST).message, SPEC)) == SPEC.horizon
        with pytest.raises(error, match=cause):
            checked_actions(client.call(LATER).message, SPEC)


def test_a_policy_states_its_name_and_the_version_of_its_module() -> None:
    with started("") as client:
        client.start()
        assert (client.said_name, client.said_version, len(client.sources)) == ("steps", "1.2", 64)


def test_a_policy_that_does_not_start_has_its_cause() -> None:
    with started("exits") as client, pytest.raises(MethodStartError, match="exited with code 3"):
        client.start()


def test_the_example_reaches_its_goal_and_closes_the_gripper() -> None:
    reach = runpy.run_path(str(EXAMPLE))["reach"]
    observation, chunks = FIRST, 0
    while len(actions := checked_actions(local_call(reach)(observation), SPEC)):
        targets = limited_targets(actions, SPEC, np.append(observation.robot.positions, observation.gripper))
        assert targets.fault == "" and (chunks := chunks + 1) < 10
        robot = replace(observation.robot, positions=targets.values[-1, :3])
        observation = replace(observation, robot=robot, gripper=float(targets.values[-1, 3]))
    assert observation.robot.positions == pytest.approx([0.0, 0.0, 0.0])
    assert observation.gripper == 1.0


POLICY_FAULTS = {
    "the joint columns seem to be in degrees": lambda o, a: np.hstack([np.degrees(a[:, :3]), a[:, 3:]]),
    "the actions seem to be velocities or deltas, they must be positions": lambda o, a: np.full_like(a, 0.02),
    "gave different results": lambda o, a: a + np.random.default_rng().uniform(0.0, 1e-3, a.shape),
    "that is not finite": lambda o, a: np.full_like(a, np.nan),
    "it must be an array of numbers of shape (8, 4)": lambda o, a: a[:, :3],
}


@pytest.mark.parametrize("sentence", POLICY_FAULTS)
def test_a_wrong_unit_kind_shape_or_seed_of_a_policy_is_named(sentence: str) -> None:
    @policy
    def faulty(observation: Observation) -> Actions:
        return Actions(POLICY_FAULTS[sentence](observation, good_policy(FIRST).actions))

    findings = check_policy(local_call(faulty), [FIRST])
    assert any(sentence in text for text in findings.faults), findings


OPENPI_KEYS = {"positions": "observation/joint_position", "gripper": "observation/gripper_position", "top": "image"}


@contextmanager
def openpi_server(metadata: bytes | str, answer: Any) -> Iterator[str]:
    """Serves as openpi's WebsocketPolicyServer: metadata first, then a response per request; yields the address."""

    def handle(connection: ServerConnection) -> None:
        try:
            connection.send(metadata)
            for data in connection:
                try:
                    connection.send(pack(answer(unpack(data))))
                except ValueError as error:
                    connection.send(f"Traceback (most recent call last):\nValueError: {error}")
                    connection.close(1011)
        except ConnectionClosed:
            pass

    with serve(handle, "127.0.0.1", 0, compression=None, max_size=None) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()


def openpi_client(address: str) -> MethodClient:
    return MethodClient(MethodSource(address=address, protocol=OPENPI), ACTIONS, MethodLimits(start_s=5.0, call_s=5.0))


def test_an_openpi_server_receives_its_keys_and_drives_with_its_actions() -> None:
    received: list[dict[str, Any]] = []

    def answer(observation: dict[str, Any]) -> dict[str, Any]:
        received.append(observation)
        return {
            "actions": GOOD,
            "state": np.zeros(8),
            "policy_timing": {"infer_ms": 20.0},
            "server_timing": {"infer_ms": 30.0},
        }

    with openpi_server(pack({"reset_pose": [0.0]}), answer) as address:
        client = openpi_client(address)
        result = client.call(openpi_request(FIRST, {**OPENPI_KEYS, "prompt": "prompt"}))
        client.close()
    assert checked_actions(result.message, SPEC) == pytest.approx(GOOD)
    assert result.times.method_s == pytest.approx(0.03)
    assert set(received[0]) == {*OPENPI_KEYS.values(), "prompt"}
    assert received[0]["prompt"] == "pick up the box"
    assert received[0]["observation/joint_position"].tolist() == pytest.approx(FIRST.robot.positions.tolist())
    assert received[0]["image"].shape == FIRST.cameras["top"].colour.shape


def test_a_server_without_times_is_charged_with_the_whole_call() -> None:
    with openpi_server(pack({}), lambda _: {"actions": GOOD}) as address:
        client = openpi_client(address)
        times = client.call(openpi_request(FIRST, OPENPI_KEYS)).times
        client.close()
    assert times.method_s > 0.0
    assert times.transport_s == 0.0


def test_the_traceback_of_an_openpi_server_is_a_fault_and_the_next_call_connects_again() -> None:
    calls: list[int] = []

    def answer(_: dict[str, Any]) -> dict[str, Any]:
        calls.append(1)
        if len(calls) == 1:
            raise ValueError("missing key image")
        return {"actions": GOOD}

    with openpi_server(pack({}), answer) as address:
        client = openpi_client(address)
        with pytest.raises(MethodRaisedError, match="ValueError: missing key image"):
            client.call(openpi_request(FIRST, OPENPI_KEYS))
        assert len(client.call(openpi_request(FIRST, OPENPI_KEYS)).message["actions"]) == SPEC.horizon
        client.close()


def test_an_openpi_server_has_the_name_that_its_metadata_state() -> None:
    with openpi_server(pack({"name": "pi0"}), lambda _: {"actions": GOOD}) as address:
        client = openpi_client(address)
        client.start()
        client.close()
    assert (client.said_name, client.said_version, client.sources) == ("pi0", "", "")


@pytest.mark.parametrize("metadata", ["hello", pack({"protocol": "mbf_method", "version": 1, "kind": "actions"})])
def test_another_server_is_no_openpi_server(metadata: bytes | str) -> None:
    with openpi_server(metadata, lambda _: {}) as address:
        client = openpi_client(address)
        with pytest.raises(
            MethodVersionError, match="is no openpi server; for a method of mbf_method, leave out openpi"
        ):
            client.start()


def test_an_openpi_response_without_actions_is_invalid() -> None:
    with openpi_server(pack({}), lambda _: {"action": GOOD}) as address:
        client = openpi_client(address)
        with pytest.raises(InvalidOutputError, match=r"the result has the fields \['action'\]"):
            checked_actions(client.call(openpi_request(FIRST, OPENPI_KEYS)).message, SPEC)
        client.close()
