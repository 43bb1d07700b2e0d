# SPDX-License-Identifier: BSD-3-Clause
"""Random problems for each planning pipeline, and the required properties of every motion."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.constraints.constraint_kinds import JointConstraint
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planners.ompl.planner import OmplPlanner
from modular_framework_planning.planners.pilz.command_planner import CommandPlanner
from modular_framework_planning.planners.stomp.planner import StompPlanner
from modular_framework_planning.planning_interface.planner_interface import Planner
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
    PoseGoal,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.plugins import make_adapters
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_testing.planning.independent_checker import IndependentChecker, Solid
from modular_framework_testing.planning.independent_checker import box as solid_box

GROUP, TIP = "arm_and_manipulator", "eg_manipulator"
BOXES = 6
SCALING = 0.5
JOINT_SCALING = {"lin": 1.0}  # of the joints' limits; SCALING unless named: a line's factors scale the tip's limits
LINE_TURNS = 0.6  # [rad]; most a joint differs between the ends of a line
ROUNDING = 1.0e-6  # of a limit: points are at whole nanoseconds, some of them 4 ms apart
PLANNERS = {"ompl": "RRTConnect", "ptp": "PTP", "lin": "LIN", "stomp": "STOMP"}
CARTESIAN_LIMITS = {"max_trans_vel": 0.5, "max_trans_acc": 1.0, "max_trans_dec": -1.0, "max_rot_vel": 1.0}


@dataclass(frozen=True)
class Problem:
    """A request, its world for the second checker, and its goal: joint positions, or a pose of the tip."""

    request: PlanningRequest
    world: list[tuple[str, Solid, np.ndarray]]
    goal: np.ndarray | pin.SE3


@dataclass
class Tally:
    """Results of a pipeline: number of motions, violated properties, and refusals by error code."""

    solved: int = 0
    violations: list[str] = field(default_factory=list)
    refusals: Counter[str] = field(default_factory=Counter)

    @property
    def unsolved_count(self) -> int:
        return self.refusals.total()


def make_pipeline(model: RobotModel, kind: str, seed: int) -> PlanningPipeline:
    """Returns the planning pipeline of a kind of problems.

    Args:
        model: Robot.
        kind: A key of `PLANNERS`.
        seed: Seed of the pipeline.
    """
    settings = PipelineSettings(seed=seed, robot_planning={"cartesian_limits": CARTESIAN_LIMITS})
    kinds: dict[str, type[Planner]] = {"ompl": OmplPlanner, "stomp": StompPlanner}
    adapters = () if kind in ("ptp", "lin") else make_adapters()
    planner = kinds.get(kind, CommandPlanner)
    return PlanningPipeline(KinematicsPool(model), settings, planner.configure(model, settings), adapters=adapters)


def _world(model: RobotModel, rng: np.random.Generator) -> tuple[PlanningScene, list[tuple[str, Solid, np.ndarray]]]:
    scene, world = empty_scene(model), []
    for number in range(BOXES):
        angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.45, 0.9)
        pose = pin.SE3(np.eye(3), np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.9, 1.6)]))
        size = rng.uniform(0.05, 0.25, 3)
        scene = scene.with_object(CollisionObject(f"b{number}", pose, ((Box(*size), pin.SE3.Identity()),)))
        world.append((f"b{number}", solid_box(*size), pose.homogeneous))
    return scene, world


def _free_state(
    model: RobotModel, checker: ExactCollisionChecker, rng: np.random.Generator, near: np.ndarray | None = None
) -> np.ndarray:
    """Returns a free state: any, or with each joint at most LINE_TURNS from another state."""
    indices = model.group(GROUP).indices
    positions = model.default_positions()
    while True:
        positions[indices] = (
            rng.uniform(-np.pi, np.pi, 6) if near is None else near[indices] + rng.uniform(-LINE_TURNS, LINE_TURNS, 6)
        )
        if checker.is_free(positions):
            return positions.copy()


def problems(model: RobotModel, kind: str, count: int, seed: int) -> Iterator[Problem]:
    """Yields problems with random worlds, starts and goals; every second problem has a path constraint, except lines.

    The goal of a line is the pose of the tip in a state near the start, so that the goal can be reached.

    Args:
        model: Robot.
        kind: A key of `PLANNERS`.
        count: Number of problems.
        seed: Seed of the problems.
    """
    rng = np.random.default_rng([seed, sorted(PLANNERS).index(kind)])
    indices = model.group(GROUP).indices
    for number in range(count):
        scene, world = _world(model, rng)
        checker = ExactCollisionChecker(scene, indices)
        start = _free_state(model, checker, rng)
        end = _free_state(model, checker, rng, start if kind == "lin" else None)
        constraints = None
        if kind == "lin":
            goal = model.link_transforms(end)[TIP]
            asked: PoseGoal | JointGoal = PoseGoal(TIP, goal)
        else:
            goal = end[indices]
            asked = JointGoal(dict(zip(model.group(GROUP).joints, goal.tolist(), strict=True)))
            if number % 2:
                joint = int(indices[0])
                low, high = sorted((start[joint], end[joint]))
                constraints = KinematicConstraints(
                    model,
                    [
                        JointConstraint(
                            model.joint_names[joint],
                            joint,
                            0.5 * (low + high),
                            0.5 * (high - low) + 0.3,
                            0.5 * (high - low) + 0.3,
                        )
                    ],
                )
        yield Problem(
            PlanningRequest(
                scene.with_positions(start),
                GROUP,
                (asked,),
                planner_id=PLANNERS[kind],
                attempts=1,
                allowed_time_s=10.0,
                velocity_scaling=SCALING,
                acceleration_scaling=SCALING,
                path_constraints=constraints,
            ),
            world,
            goal,
        )


def violations(
    model: RobotModel, checker: IndependentChecker, problem: Problem, answer: PlanningResult, scaling: float
) -> list[str]:
    """Returns the properties that a motion lacks, on the curve of a controller sampled every 1 ms.

    Collisions are sought along the curve and along the straight lines between the points.

    Args:
        model: Robot.
        checker: Second checker; gets the world of the problem.
        problem: Problem.
        answer: Response with the motion.
        scaling: Allowed fraction of the joints' velocity and acceleration limits.
    """
    motion, indices = answer.trajectory, model.group(GROUP).indices
    faults = []
    if motion.times[0] != 0.0 or not (np.diff(motion.times) > 0.0).all():
        faults.append("times do not increase strictly")
    positions, velocities, accelerations, _ = motion.sample(motion.sample_times(0.001))
    shares = (
        (np.abs(velocities) / model.max_velocity[indices]).max(),
        (np.abs(accelerations) / model.max_acceleration[indices]).max(),
    )
    faults += [
        f"{name} is {share / scaling:.7f} of its limit"
        for name, share in zip(("velocity", "acceleration"), shares, strict=True)
        if share > scaling * (1.0 + ROUNDING)
    ]
    if (positions < model.lower[indices] - 1e-9).any() or (positions > model.upper[indices] + 1e-9).any():
        faults.append("a position is out of bounds")
    if not np.allclose(positions[0], problem.request.scene.positions[indices], atol=1e-9):
        faults.append("the motion does not begin at the start")
    faults += _goal_faults(model, problem, positions[-1])
    constraints = problem.request.path_constraints
    rest = problem.request.scene.positions.copy()
    if constraints is not None:
        for row in positions:
            rest[indices] = row
            if not constraints.are_satisfied(rest):
                faults.append(f"path constraint: {constraints.describe(rest)}")
                break
    checker.set_world(problem.world)
    named = dict(zip(model.joint_names, problem.request.scene.positions.tolist(), strict=True))
    hits = sum(
        checker.colliding_states(motion.joint_names, line, named) for line in (motion.curve(0.01), *motion.chords())
    )
    return faults + ([f"{hits} states collide"] if hits else [])


def _goal_faults(model: RobotModel, problem: Problem, end: np.ndarray) -> list[str]:
    if isinstance(problem.goal, np.ndarray):
        return [] if np.allclose(end, problem.goal, atol=1e-6) else ["the motion does not end at the goal"]
    full_positions = problem.request.scene.positions.copy()
    full_positions[model.group(GROUP).indices] = end
    error = pin.log6(model.link_transforms(full_positions)[TIP].actInv(problem.goal)).vector
    return [] if np.abs(error).max() < 1e-3 else [f"the motion ends {np.abs(error).max():.4f} from the goal"]


def _groundless(model: RobotModel, checker: IndependentChecker, problem: Problem, kind: str) -> list[str]:
    """Returns the fault of a refusal: the straight motion of a point-to-point command must be in collision.

    Random path constraints are chosen to hold along this motion.
    """
    if kind != "ptp":
        return []
    checker.set_world(problem.world)
    start = problem.request.scene.positions
    line = np.array([start[model.group(GROUP).indices], problem.goal])
    named = dict(zip(model.joint_names, start.tolist(), strict=True))
    touches = any(
        checker.colliding_states(list(model.group(GROUP).joints), line, named, step) for step in (0.01, 0.001, 0.00025)
    )
    return [] if touches else ["refused, though the straight motion is free"]


def examine(model: RobotModel, checker: IndependentChecker, kind: str, count: int, seed: int = 1) -> Tally:
    """Plans random problems and collects the faults of motions and refusals.

    Args:
        model: Robot.
        checker: Second checker of the robot.
        kind: A key of `PLANNERS`.
        count: Number of problems.
        seed: Seed of problems and pipeline.
    """
    pipeline, tally = make_pipeline(model, kind, seed), Tally()
    for number, problem in enumerate(problems(model, kind, count, seed)):
        try:
            answer = pipeline.plan(problem.request)
        except PlanningError as error:
            tally.refusals[ErrorCode(error.code).name] += 1
            faults = _groundless(model, checker, problem, kind)
        else:
            tally.solved += 1
            faults = violations(model, checker, problem, answer, JOINT_SCALING.get(kind, SCALING))
        tally.violations += [f"{kind} {number}: {text}" for text in faults]
    return tally
