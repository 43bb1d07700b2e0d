# SPDX-License-Identifier: BSD-3-Clause
"""Planner in its own process: sends each problem to the process and checks the returned path."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from mbf_method.errors import CallCancelledError, MethodError, MethodFault, MethodLateError
from mbf_method.joint_path import checked_path
from mbf_method.method_client import CallTimes, MethodClient, MethodLimits, MethodSource
from mbf_method.served_method import PATHS
from modular_framework_planning.errors import ErrorCode, ModelError, PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.plan_statistics import PlanStatistics
from modular_framework_planning.planners.external.path_request import path_request, portable_urdf
from modular_framework_planning.planning_interface.planner_interface import (
    PlannedPath,
    Planner,
    PlanningProblem,
    no_path,
)
from modular_framework_planning.planning_interface.planning_request import PipelineSettings
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader, existing_declaration
from modular_framework_ros.reported_figures import (
    PLANNER_FAULT,
    PLANNER_METHOD_TIME,
    PLANNER_QUEUE_TIME,
    PLANNER_TRANSPORT_TIME,
)

CODES = {
    MethodFault.NOT_STARTED: ErrorCode.COMMUNICATION_FAILURE,
    MethodFault.DIED: ErrorCode.COMMUNICATION_FAILURE,
    MethodFault.LATE: ErrorCode.TIMED_OUT,
    MethodFault.RAISED: ErrorCode.PLANNING_FAILED,
    MethodFault.INVALID_RESULT: ErrorCode.INVALID_MOTION_PLAN,
    MethodFault.TOO_LARGE: ErrorCode.INVALID_MOTION_PLAN,
}


class ExternalPlanner(Planner):
    """Planner that a function in another process implements; this class starts the process or connects to it.

    The path is timed and validated as the process returns it, without shortening. A fault ends the plan, and the next
    plan starts the process again. Plans of several threads wait for each other.

    Parameters of the pipeline: see `parameters/external_planner.yaml`.
    """

    description = "planner in its own process"
    has_own_process = True

    def __init__(self, source: MethodSource, limits: MethodLimits, max_points: int, urdf: str) -> None:
        """Stores the arguments without starting the process.

        Args:
            source: Location of the planner.
            limits: Time limit of the start and size limit of a result.
            max_points: Maximum number of points of a path.
            urdf: Robot description of the requests.
        """
        self._client = MethodClient(source, PATHS, limits)
        self._max_points = max_points
        self._urdf = urdf
        self._turn = threading.Lock()

    @classmethod
    def configure(cls, model: RobotModel, settings: PipelineSettings) -> ExternalPlanner:
        """Returns the planner of a pipeline; raises ModelError for an invalid parameter."""
        reader = ParameterReader(
            existing_declaration("modular_framework_planning", "external_planner"), settings.parameters.get
        )
        try:
            values = reader.all()
        except ParameterError as error:
            raise ModelError(f"external planner: {error}") from error
        source = MethodSource(tuple(values["command"]), values["address"], values["record_inputs"])
        limits = MethodLimits(start_s=values["start_limit"], result_bytes=values["size_limit"])
        return cls(source, limits, values["max_path_points"], portable_urdf(model))

    def start(self) -> None:
        """Starts the process; no effect while it runs. Raises PlanningError if it does not start."""
        with self._turn:
            try:
                self._client.start()
            except MethodError as error:
                raise _planning_error(error) from error

    def close(self) -> None:
        """Ends the process, and with it a running plan."""
        self._client.close()

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        """Returns the checked path of the process; raises PlanningError for a fault of the process."""
        if problem.constraints is not None:
            raise PlanningError(
                ErrorCode.PLANNING_FAILED,
                "path constraints: an external planner supports none; use another pipeline",
            )
        goals = problem.goal_states()
        try:
            with self._own_turn(problem) as waited_s:
                path = self._path(problem, goals, waited_s)
        except MethodError as error:
            problem.phases.figures[PLANNER_FAULT] = float(error.fault)
            raise _planning_error(error) from error
        except CallCancelledError as error:
            raise no_path(problem, "the external planner") from error
        if not len(path):
            raise no_path(problem, "the external planner")
        return PlannedPath(path, keep_shape=True)

    def _path(self, problem: PlanningProblem, goals: Array, waited_s: float) -> Array:
        request = path_request(problem, goals, self._urdf)
        self._client.start()
        problem.phases.record_sources(self._client.sources)
        result = self._client.call(request, _remaining_s(problem), problem.cancelled)
        _record_times(problem, result.times, waited_s)
        return checked_path(result.message, request, self._max_points)

    @contextmanager
    def _own_turn(self, problem: PlanningProblem) -> Iterator[float]:
        """Waits for the plans of other threads and for the start of the process; yields the duration of the wait."""
        start_s = time.monotonic()
        while not self._turn.acquire(timeout=0.1):
            _remaining_s(problem)
            if problem.cancelled():
                raise CallCancelledError("the plan was cancelled while other plans ran")
        try:
            yield time.monotonic() - start_s
        finally:
            self._turn.release()


def _remaining_s(problem: PlanningProblem) -> float:
    """Returns the time until the deadline of a plan [s]; raises MethodLateError if there is none."""
    remaining_s = problem.deadline_s - time.monotonic()
    if remaining_s <= 0.0:
        raise MethodLateError(
            f"other plans and the start of the process took all of the allowed {problem.request.allowed_time_s:g} s"
        )
    return remaining_s


def _record_times(problem: PlanningProblem, times: CallTimes, waited_s: float) -> None:
    problem.phases.remote_processor_s += times.processor_s
    problem.phases.figures |= {
        PLANNER_METHOD_TIME: times.method_s,
        PLANNER_QUEUE_TIME: times.queue_s + waited_s,
        PLANNER_TRANSPORT_TIME: times.transport_s,
    }


def _planning_error(error: MethodError) -> PlanningError:
    statistics = PlanStatistics(figures={PLANNER_FAULT: float(error.fault)})
    return PlanningError(CODES[error.fault], f"the external planner failed: {error}", statistics=statistics)
