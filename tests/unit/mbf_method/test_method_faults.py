# SPDX-License-Identifier: BSD-3-Clause
"""Calls of a method in another process: each fault ends the call in time, and the error names the cause."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest

from mbf_method import CameraView, GraspRequest
from mbf_method.errors import (
    MethodDiedError,
    MethodError,
    MethodLateError,
    MethodRaisedError,
    MethodStartError,
    MethodVersionError,
    TooLargeError,
)
from mbf_method.method_client import MethodClient, MethodLimits, MethodSource
from mbf_method.method_process import MethodProcess
from mbf_method.served_method import GRASPS
from mbf_method.wire import VERSION

FAULTY_METHOD = str(Path(__file__).parent / "faulty_method.py")
FAULTY_SEED = 13
SPARE_S = 8.0
"""Time for the end of a process, in addition to the limits of a call."""

MakeClient = Callable[..., MethodClient]


@pytest.fixture
def make_client() -> Iterator[MakeClient]:
    """Yields a function that creates the client of a faulty method; then checks that no process remains."""
    clients: list[MethodClient] = []

    def make(fault: str, **limits: float) -> MethodClient:
        source = MethodSource(command=(sys.executable, FAULTY_METHOD, fault))
        clients.append(MethodClient(source, GRASPS, MethodLimits(**limits)))
        return clients[-1]

    yield make
    for client in clients:
        client.close()
    assert not children()


def children() -> list[psutil.Process]:
    return psutil.Process().children(recursive=True)


def test_each_call_leaves_its_own_input_in_the_folder_of_recorded_inputs(
    tmp_path: Path, box_request: GraspRequest
) -> None:
    source = MethodSource(command=(sys.executable, FAULTY_METHOD, "none"), record_folder=str(tmp_path / "inputs"))
    client = MethodClient(source, GRASPS, MethodLimits())
    try:
        client.call(box_request)
        first = {path.name: path.read_bytes() for path in (tmp_path / "inputs").iterdir()}
        client.call(box_request)
        (tmp_path / "inputs" / next(iter(first))).unlink()
        client.call(box_request)
        assert len(list((tmp_path / "inputs").iterdir())) == 2
    finally:
        client.close()


def test_a_method_in_another_process_returns_its_result(make_client: MakeClient, box_request: GraspRequest) -> None:
    started_s = time.perf_counter()
    client = make_client("takes its time")
    client.start()
    ready_s = time.perf_counter()
    result = client.call(box_request)
    ended_s = time.perf_counter()
    assert result.message["poses"].shape == (3, 4, 4)
    assert result.message["frame"] == "world"
    times = result.times
    assert times.method_s >= 0.2
    assert times.method_s + times.queue_s + times.transport_s == pytest.approx(ended_s - ready_s, abs=0.01)
    assert ready_s > started_s


@pytest.mark.parametrize(
    ("fault", "error", "cause"),
    [
        ("dies", MethodDiedError, "was ended by SIGKILL"),
        ("hangs", MethodLateError, "no result within 1 s"),
        ("raises", MethodRaisedError, "ValueError: no weights"),
        ("returns nothing", MethodRaisedError, "returned a NoneType; it must return Grasps"),
        ("is too large", TooLargeError, "larger than 100000 bytes"),
    ],
)
def test_a_fault_ends_the_call_and_the_next_call_succeeds(
    make_client: MakeClient, box_request: GraspRequest, fault: str, error: type[MethodError], cause: str
) -> None:
    client = make_client(fault, call_s=1.0, result_bytes=100_000)
    client.start()
    started_s = time.monotonic()
    with pytest.raises(error, match=cause):
        client.call(replace(box_request, seed=FAULTY_SEED))
    assert time.monotonic() - started_s < 1.0 + SPARE_S
    assert client.call(box_request).message["scores"].tolist() == [0.5, 0.5, 0.5]


@pytest.mark.parametrize(
    ("fault", "error", "cause"),
    [
        ("exits", MethodStartError, "exited with code 3 before the method was ready"),
        ("never listens", MethodStartError, "not ready within 2 s"),
        (
            "has another version",
            MethodVersionError,
            f"version {VERSION + 1}, kind 'grasps'; required: 'mbf_method', {VERSION}",
        ),
    ],
)
def test_a_method_that_does_not_start_has_its_cause(
    make_client: MakeClient, fault: str, error: type[MethodError], cause: str
) -> None:
    with pytest.raises(error, match=cause):
        make_client(fault, start_s=2.0 if fault == "never listens" else 30.0).start()
    assert not children()


@pytest.mark.parametrize(
    ("source", "cause"),
    [
        (MethodSource(command=("/no/such/python", "method.py")), "cannot be started: .*No such file"),
        (MethodSource(), "either a command that starts it, or its address"),
        (MethodSource(command=("python3",), address="ws://127.0.0.1:1"), "set one of them"),
        (MethodSource(address="127.0.0.1:8700"), "is not the address of a method"),
        (MethodSource(address="ws://127.0.0.1:1"), "not ready within 0.5 s: .*refused"),
    ],
)
def test_a_wrong_source_has_its_cause(source: MethodSource, cause: str) -> None:
    with pytest.raises(MethodStartError, match=cause):
        MethodClient(source, GRASPS, MethodLimits(start_s=0.5)).start()


def test_a_method_of_another_kind_is_refused(make_client: MakeClient) -> None:
    client = MethodClient(MethodSource(command=(sys.executable, FAULTY_METHOD, "none")), "policy", MethodLimits())
    with pytest.raises(MethodVersionError, match=f"kind 'grasps'; required: 'mbf_method', {VERSION}, 'policy'"):
        client.start()
    assert not children()


def test_a_stopped_method_that_reads_no_request_is_late(make_client: MakeClient, box_request: GraspRequest) -> None:
    client = make_client("none", call_s=1.0)
    client.start()
    (method,) = children()
    method.suspend()
    large = replace(box_request, target=replace(box_request.target, points=np.zeros((1_000_000, 3))))
    started_s = time.monotonic()
    with pytest.raises(MethodLateError):
        client.call(large)
    assert time.monotonic() - started_s < 1.0 + SPARE_S
    assert not children()


def test_a_method_receives_the_images_that_it_needs(make_client: MakeClient, box_request: GraspRequest) -> None:
    client = make_client("needs a camera")
    client.start()
    assert client.needs_camera
    depth = np.arange(12, dtype=np.float32).reshape(3, 4)
    view = CameraView(depth, np.zeros((3, 4, 3), np.uint8), np.eye(3), np.eye(4))
    result = client.call(replace(box_request, camera=view))
    assert result.message["scores"].tolist() == [0.0, 0.0, 11.0]


def test_requests_of_two_clients_wait_for_each_other(box_request: GraspRequest) -> None:
    process = MethodProcess((sys.executable, FAULTY_METHOD, "takes its time"))
    clients = [MethodClient(MethodSource(address=process.address), GRASPS, MethodLimits()) for _ in range(2)]
    queues_s: list[float] = []
    try:
        for client in clients:
            client.start()
        calls = [
            threading.Thread(target=lambda client=client: queues_s.append(client.call(box_request).times.queue_s))
            for client in clients
        ]
        for call in calls:
            call.start()
        for call in calls:
            call.join()
        assert max(queues_s) > 0.1
        assert min(queues_s) < 0.1
    finally:
        for client in clients:
            client.close()
        process.close()


def test_a_method_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    code = (
        "import sys, time\nfrom mbf_method.method_client import *\n"
        f"source = MethodSource(({sys.executable!r}, {FAULTY_METHOD!r}, 'none'))\n"
        "client = MethodClient(source, 'grasps', MethodLimits())\n"
        "client.start(); print('ready', flush=True); time.sleep(600)"
    )
    framework = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert framework.stdout is not None
    assert "ready\n" in iter(framework.stdout.readline, "")
    (method,) = psutil.Process(framework.pid).children()
    framework.kill()
    framework.wait()
    method.wait(10.0)


def test_the_environment_of_the_framework_does_not_reach_the_method(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "import os, pathlib\npathlib.Path(__file__).with_name('variables').write_text(' '.join(os.environ))"
    )
    assert "PYTHONPATH" in os.environ
    process = MethodProcess((sys.executable, str(program)))
    assert "exited with code 0" in process.end_text(10.0)
    variables = (tmp_path / "variables").read_text().split()
    assert "PYTHONPATH" not in variables
    assert "MBF_METHOD_PORT" in variables
