# SPDX-License-Identifier: BSD-3-Clause
"""Seeded planning: each request runs in a new process that starts from the same state."""

from __future__ import annotations

import os
import pickle
import select
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from multiprocessing.connection import Client, Connection
from pathlib import Path

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.planning_interface.planning_request import PlanningRequest, PlanningResult
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_pipeline.plugins import planner_class
from modular_framework_planning.reproducible.scene_pickling import from_bytes, to_bytes
from modular_framework_planning.reproducible.seeded_worker import WorkerSetup
from modular_framework_planning.robot_model.robot_model import RobotModel

WORKER = "modular_framework_planning.reproducible.seeded_worker"
POLL_S = 0.02
START_TIMEOUT_S = 300.0
GRACE_S = 30.0  # time beyond the allowed planning time until the child process must respond
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


def _never_cancelled() -> bool:
    return False


class SeededPlanning:
    """Client of the worker process, which is started by the first request; thread-safe.

    Planners with a process of their own plan there, with the seed in the request.
    """

    def __init__(self, model: RobotModel, specs: Sequence[PipelineSpec]) -> None:
        """Stores the setup of the worker.

        Args:
            model: Robot model.
            specs: Specifications of the pipelines.
        """
        self._model = model
        self._specs = tuple(spec for spec in specs if not planner_class(spec.planner).has_own_process)
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._address = ""

    def plan(self, pipeline: PlanningPipeline, request: PlanningRequest, seed: int) -> PlanningResult:
        """Plans in a new process; equal requests, scenes and seeds give equal trajectories.

        Args:
            pipeline: Pipeline of a stored specification, whose current settings are used.
            request: Planning request.
            seed: Random seed, at least 0.

        Raises:
            PlanningError: Planning failed, or the process did not start or crashed.
        """
        if seed < 0:
            raise PlanningError(ErrorCode.FAILURE, f"seed is {seed}; it must be at least 0")
        if pipeline.has_own_process:
            return pipeline.plan(replace(request, seed=seed), repeatable=True)
        connection = self._connect()
        try:
            configurations = pipeline.configurations.snapshot()
            message = (
                pipeline.name,
                pipeline.settings,
                configurations,
                seed,
                replace(request, cancelled=_never_cancelled),
            )
            connection.send_bytes(to_bytes(message))
            self._wait(connection, request)
            result = from_bytes(connection.recv_bytes(), self._model)
        except (EOFError, OSError) as error:
            raise PlanningError(
                ErrorCode.CRASH,
                f"the process of a seeded plan ended without a result ({error}); its output is in the log of this node",
            ) from error
        finally:
            connection.close()
        if isinstance(result, PlanningError):
            raise result
        return result

    def start(self) -> None:
        """Starts the worker process and waits until it is ready; raises PlanningError if it does not start.

        No effect if all planners have a process of their own.
        """
        with self._lock:
            if not self._specs or (self._process is not None and self._process.poll() is None):
                return
            self._stop()
            self._folder = tempfile.TemporaryDirectory(prefix="seeded_planning_")
            self._address = str(Path(self._folder.name) / "socket")
            setup = WorkerSetup(self._model.source, self._specs, tuple(sys.path), self._address)
            data = pickle.dumps(tuple(sys.path)) + pickle.dumps(
                setup
            )  # the path is needed to load the classes of the setup
            self._process = subprocess.Popen(
                [sys.executable, "-m", WORKER],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(item for item in sys.path if item)},
            )
            assert self._process.stdin is not None and self._process.stdout is not None
            self._process.stdin.write(data)
            self._process.stdin.flush()
            ready, _, _ = select.select([self._process.stdout], [], [], START_TIMEOUT_S)
            if not ready or self._process.stdout.readline() != b"ready\n":
                self._stop()
                raise PlanningError(
                    ErrorCode.CRASH,
                    "the process for seeded plans was not ready within "
                    f"{START_TIMEOUT_S:.0f} s; its output is in the log of this node",
                )

    def close(self) -> None:
        """Stops the worker process; may be called twice."""
        with self._lock:
            self._stop()

    def _stop(self) -> None:
        if self._process is not None:
            assert self._process.stdin is not None and self._process.stdout is not None
            self._process.stdin.close()
            self._process.stdout.close()
            try:
                self._process.wait(2.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _connect(self) -> Connection:
        self.start()
        try:
            return Client(self._address, "AF_UNIX")
        except OSError as error:
            raise PlanningError(ErrorCode.CRASH, f"the process for seeded plans cannot be reached: {error}") from error

    def _wait(self, connection: Connection, request: PlanningRequest) -> None:
        """Waits for a result; raises PlanningError on cancellation or timeout."""
        end_s = time.monotonic() + request.allowed_time_s + GRACE_S
        start_s = time.monotonic()
        while True:
            if request.cancelled():
                raise PlanningError(
                    ErrorCode.PREEMPTED, f"planning was cancelled after {time.monotonic() - start_s:.2f} s"
                )
            if time.monotonic() > end_s:
                raise PlanningError(
                    ErrorCode.TIMED_OUT,
                    f"the process of a seeded plan sent no result within {request.allowed_time_s + GRACE_S:.0f} s",
                )
            if connection.poll(POLL_S):
                return
