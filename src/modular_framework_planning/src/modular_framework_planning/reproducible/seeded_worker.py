# SPDX-License-Identifier: BSD-3-Clause
"""Worker process of seeded planning, which loads the robot once and forks a child for every request.

OMPL has one random generator per process, which can be seeded only before its first use. The worker never plans
itself, so that all children start from the same state. It has one thread and runs until its standard input is closed.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import signal
import socket
import sys
import traceback
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from pinocchio import SE3 as Transform

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_pipeline.plugins import make_adapters
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, empty_scene
from modular_framework_planning.process_setup.compile_loops import compile_all
from modular_framework_planning.process_setup.garbage_collection import freeze_loaded_objects
from modular_framework_planning.reproducible.scene_pickling import from_bytes, to_bytes
from modular_framework_planning.robot_model.robot_model import RobotModel


@dataclass(frozen=True, slots=True)
class WorkerSetup:
    """Setup of the worker process.

    Attributes:
        robot: Arguments of RobotModel.
        pipelines: Specifications of the pipelines.
        search_path: Import path of the parent process, for user-defined planners.
        address: Path of the socket to listen on.
    """

    robot: tuple[Any, ...]
    pipelines: tuple[PipelineSpec, ...]
    search_path: tuple[str, ...]
    address: str


def serve(setup: WorkerSetup, model: RobotModel, pipelines: dict[str, PlanningPipeline]) -> None:
    """Forks a child for every connection until standard input is closed.

    Args:
        setup: Setup of the worker process.
        model: Robot model.
        pipelines: Pipelines, keyed by name.
    """
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(setup.address)
    listener.listen(64)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while True:
        ready, _, _ = select.select([listener, sys.stdin], [], [])
        if sys.stdin in ready:
            return
        accepted, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            _child(Connection(accepted.detach()), model, pipelines)
        accepted.close()


def _child(connection: Connection, model: RobotModel, pipelines: dict[str, PlanningPipeline]) -> None:
    """Answers a request and ends the process."""
    try:
        name, settings, configurations, seed, request = from_bytes(connection.recv_bytes(), model)

        def cancelled() -> bool:
            return bool(
                select.select([connection], [], [], 0.0)[0]
            )  # becomes readable when the parent closes the connection

        pipeline = pipelines[name]
        pipeline.settings = settings
        pipeline.configurations.restore(configurations)
        connection.send_bytes(to_bytes(_answer(pipeline, replace(request, cancelled=cancelled), seed)))
    except (EOFError, OSError):
        os._exit(1)  # the parent closed the connection
    os._exit(0)


def _answer(pipeline: PlanningPipeline, request: Any, seed: int) -> PlanningResult | PlanningError:
    import ompl.util as ou

    try:
        ou.RNG.setSeed(1 + seed % (2**31 - 1))  # OMPL ignores the seed 0
        return pipeline.plan(replace(request, seed=seed), repeatable=True)
    except PlanningError as error:
        return error
    except Exception as error:  # noqa: BLE001 - every failure must be reported to the parent
        traceback.print_exc()
        return PlanningError(ErrorCode.FAILURE, f"unexpected {type(error).__name__}: {error}")


def _warm_up(model: RobotModel, kinematics: KinematicsPool) -> None:
    """Loads compiled loops and, by planning a motion of every group, meshes, so that all children share them."""
    compile_all()
    far = Transform(np.eye(3), np.array([50.0, 0.0, 0.0]))
    scene = empty_scene(model).with_object(CollisionObject("far", far, ((Box(1.0, 1.0, 1.0), Transform.Identity()),)))
    straight = PlanningPipeline(kinematics, PipelineSettings(), _StraightLinePlanner(), adapters=make_adapters())
    for group in model.groups.values():
        if not group.joints:
            continue
        middle = 0.5 * (model.lower + model.upper)[group.indices]
        goal = JointGoal(
            dict(
                zip(
                    group.joints,
                    (scene.positions[group.indices] + 0.01 * np.sign(middle - scene.positions[group.indices])).tolist(),
                    strict=True,
                )
            )
        )
        with contextlib.suppress(PlanningError):
            straight.plan(PlanningRequest(scene, group.name, (goal,)))


def _wait_for_children(*_: object) -> None:
    """Reaps ended children, because the processor time of ignored children is not counted."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


class _StraightLinePlanner(Planner):
    """Planner without OMPL, whose random generator must stay unused in the worker."""

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        """Returns the straight path to the nearest goal."""
        problem.edge_is_valid(problem.start_values, problem.goal_states()[0])
        return PlannedPath(np.vstack([problem.start_values, problem.goal_states()[0]]))


def main() -> None:
    """Reads the setup from standard input, loads the robot and serves requests."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, _wait_for_children)
    sys.path[:] = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent process
    setup: WorkerSetup = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent process
    model = RobotModel(*setup.robot)
    kinematics = KinematicsPool(model)
    pipelines = {spec.name: spec.build(model, kinematics) for spec in setup.pipelines}
    _warm_up(model, kinematics)
    freeze_loaded_objects()
    serve(setup, model, pipelines)


if __name__ == "__main__":
    main()
