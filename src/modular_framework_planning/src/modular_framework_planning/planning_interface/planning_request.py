# SPDX-License-Identifier: BSD-3-Clause
"""Requests to the planner and its answers, free of messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.plan_statistics import PlanStatistics
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel
from modular_framework_planning.trajectory_processing.trajectory import Trajectory
from modular_framework_urdf.mimics import Mimic

if TYPE_CHECKING:
    from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints

PARTS_OF_MOTION_STEP = 100  # costs nothing away from contact: a known clearance covers many samples at once
DEFAULT_PLANNER = "default_planner_config"  # parameter of a group or a pipeline
SAME_POSITION = 1.0e-4  # [rad or m]; positions of joints that follow each other need not agree better


@dataclass(frozen=True, slots=True)
class JointGoal:
    """Joint targets [rad or m] with allowed deviations below and above."""

    positions: Mapping[str, float]
    below: Mapping[str, float] = field(default_factory=dict)
    above: Mapping[str, float] = field(default_factory=dict)

    def of_independent_joints(self, mimics: Mapping[str, Mimic]) -> JointGoal:
        """Returns the goal in which mimic joints are replaced by what they ask of their leaders.

        Raises:
            PlanningError: no position of a leader satisfies all that is asked of it.
        """
        targets = {name: value for name, value in self.positions.items() if name not in mimics}
        low = {name: value - self.below.get(name, 0.0) for name, value in targets.items()}
        high = {name: value + self.above.get(name, 0.0) for name, value in targets.items()}
        for name in self.positions.keys() & mimics.keys():
            mimic, value = mimics[name], self.positions[name]
            ends = sorted(
                mimic.leader_position(end)
                for end in (value - self.below.get(name, 0.0), value + self.above.get(name, 0.0))
            )
            leader = mimic.leader
            low[leader], high[leader] = max(low.get(leader, -np.inf), ends[0]), min(high.get(leader, np.inf), ends[1])
            targets.setdefault(leader, mimic.leader_position(value))
            if low[leader] > high[leader] + SAME_POSITION:
                raise PlanningError(
                    ErrorCode.INVALID_GOAL_CONSTRAINTS,
                    f"goal: joint '{name}' at {value:.4f} asks "
                    f"'{leader}', which it mimics, to be at {mimic.leader_position(value):.4f}; the goal asks "
                    f"another position of '{leader}', too; give positions that fit, or leave joints "
                    "that mimic out",
                )
        inside = {name: max(low[name], min(target, high[name])) for name, target in targets.items()}
        return JointGoal(
            inside,
            {name: max(target - low[name], 0.0) for name, target in inside.items()},
            {name: max(high[name] - target, 0.0) for name, target in inside.items()},
        )


@dataclass(frozen=True, slots=True, eq=False)
class PoseGoal:
    """A link's target pose in the planning frame; `allowed` constrains the other poses that reach the goal."""

    link: str
    target: Transform
    allowed: KinematicConstraints | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintGoal:
    """Any state that satisfies constraints of any mix."""

    constraints: KinematicConstraints


@dataclass(frozen=True, slots=True)
class SamplingSettings:
    """Parameters below ~ompl: whether the paths that are found are shortened."""

    simplify_solutions: bool = True


@dataclass(frozen=True, slots=True)
class PipelineSettings:
    """Settings of a pipeline, for what a request leaves open; names as in the config package.

    Attributes:
        start_state_max_bounds_error: how far out of bounds a start is pulled back [rad or m].
        jiggle_fraction: how far from a colliding start a free one is searched (share of the joint's range).
        start_state_collision_depth: a start that collides deeper than this is refused at once [m].
        start_state_contact_tolerance: depth of a held body's contact tolerated at the start [m].
        motion_step: distance of checks along a motion [rad or m]; collisions of the returned one are checked at
            `finest_step`.
        blend_deviation: most distance a rounded corner keeps from the corner [rad or m].
        start_state_max_dt: longest way back from a start out of bounds to the bounds [s].
        default_workspace_bounds: edge of the cube a request's workspace is where it gives none [m].
        planner_configs: named settings of planners; groups: what the pipeline's parameters hold below each group.
        parameters: everything below the pipeline's name on the parameter server.
        robot_planning: robot_description_planning (joint_limits, cartesian_limits, ...).
        seed: of every plan of the pipeline; None for fresh random numbers each time.
        seeded_iterations: after how many a planner that goes on to improve its path stops, where a seed is set.
        search_threads: searches of RRTConnect that run at the same time for one request, of which the first path wins;
            0 for as many as pay.
        sampling: of paths that are searched.
    """

    start_state_max_bounds_error: float = 0.1
    start_state_max_dt: float = 0.5
    jiggle_fraction: float = 0.02
    max_sampling_attempts: int = 100
    start_state_collision_depth: float = 0.01
    start_state_contact_tolerance: float = 0.003
    search_step: float = 0.05
    motion_step: float = 0.004
    blend_deviation: float = 0.1
    default_workspace_bounds: float = 10.0
    default_velocity_scaling_factor: float = 0.1
    default_acceleration_scaling_factor: float = 0.1
    planner_configs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    groups: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    robot_planning: Mapping[str, Any] = field(default_factory=dict)
    seed: int | None = None
    seeded_iterations: int = 2000
    search_threads: int = 0
    sampling: SamplingSettings = field(default_factory=SamplingSettings)

    @property
    def finest_step(self) -> float:
        """Distance of states checked before a motion is returned [rad or m]: bodies that graze touch only briefly."""
        return self.motion_step / PARTS_OF_MOTION_STEP

    def default_planner(self, group: str) -> str:
        """Returns the planner of requests that name none; empty where no parameter says.

        MoveIt's Setup Assistant writes `None` for a group without one.
        """
        given = (self.groups.get(group, {}).get(DEFAULT_PLANNER), self.parameters.get(DEFAULT_PLANNER))
        return next((str(name) for name in given if name and name != "None"), "")


@dataclass(frozen=True, slots=True, eq=False)
class Workspace:
    """The box a moving base may be in: lower and upper corner in the planning frame [m], each of shape (3,)."""

    lower: Array
    upper: Array


def group_bounds(model: RobotModel, group: JointGroup, workspace: Workspace | None) -> tuple[Array, Array]:
    """Returns lower and upper bounds of a group's joints, each of shape (joints,) [rad or m].

    As in MoveIt the workspace bounds where a planar or floating base may be, if the group moves it.
    """
    lower, upper = model.lower[group.indices], model.upper[group.indices]
    if model.base is None or workspace is None:
        return lower, upper
    for axis, name in enumerate(model.base.translations):
        if name in group.joints:
            column = group.joints.index(name)
            lower[column] = max(lower[column], workspace.lower[axis])
            upper[column] = min(upper[column], workspace.upper[axis])
    return lower, upper


@dataclass(frozen=True, slots=True, eq=False)
class AuxiliaryPoint:
    """A point that shapes a motion: "center" or "interim" of a circle, in the planning frame [m], shape (3,)."""

    name: str
    position: Array


@dataclass(frozen=True, slots=True, eq=False)
class PlanningRequest:
    """One request to the planner.

    Attributes:
        scene: snapshot with the start positions and attached objects already in it.
        goals: alternatives; reaching one is enough.
        velocity_scaling, acceleration_scaling: 0 asks for the default.
        pipeline_id, planner_id: empty for the default.
        start_velocities: joint velocities at the start that are known [rad/s or m/s].
        path_constraints: what every state of the motion must satisfy.
        max_cartesian_speed: of cartesian_speed_limited_link [m/s]; 0 for none.
        seed: makes the plan repeatable; None for the pipeline's own.
        most_iterations: of one search that would go on until its time is over; None where the clock alone bounds it.
        auxiliary_point: of a circular motion.
    """

    scene: PlanningScene
    group: str
    goals: tuple[JointGoal | PoseGoal | ConstraintGoal, ...]
    planner_id: str = ""
    attempts: int = 1
    allowed_time_s: float = 5.0
    velocity_scaling: float = 0.0
    acceleration_scaling: float = 0.0
    cancelled: Callable[[], bool] = field(default=lambda: False)
    pipeline_id: str = ""
    start_velocities: Mapping[str, float] = field(default_factory=dict)
    path_constraints: KinematicConstraints | None = None
    max_cartesian_speed: float = 0.0
    cartesian_speed_limited_link: str = ""
    workspace: Workspace | None = None
    seed: int | None = None
    most_iterations: int | None = None
    auxiliary_point: AuxiliaryPoint | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PlanningAnswer:
    """A checked motion.

    Attributes:
        start, goal: positions of the whole robot.
        planning_time_s: time until a path was found; total_time_s: until the checked, timed motion was ready.
        path: vertices of the shortened path, shape (n, joints).
        statistics: what the parts of the plan took, see phase_times.
    """

    trajectory: Trajectory
    start: Array
    goal: Array
    path: Array
    planner_id: str
    planning_time_s: float
    total_time_s: float
    statistics: PlanStatistics = field(default_factory=PlanStatistics)

    @property
    def phases_s(self) -> Mapping[str, float]:
        """How long the parts of the plan took [s]."""
        return self.statistics.phases_s
