# SPDX-License-Identifier: BSD-3-Clause
"""Planning requests, pipeline settings and planning results, independent of ROS messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field
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

CHECKS_PER_MOTION_STEP = 100  # far from obstacles, one clearance certifies many states
DEFAULT_PLANNER = "default_planner_config"  # name of the parameter in a group or a pipeline
MIMIC_TOLERANCE = 1.0e-4  # accepted difference between a mimic joint and its leader [rad or m]


@dataclass(frozen=True, slots=True)
class JointGoal:
    """Joint targets [rad or m] with allowed deviations below and above."""

    positions: Mapping[str, float]
    below: Mapping[str, float] = field(default_factory=dict)
    above: Mapping[str, float] = field(default_factory=dict)

    def without_mimic_joints(self, mimics: Mapping[str, Mimic]) -> JointGoal:
        """Returns the goal with the targets of mimic joints converted to targets of their leaders.

        Raises:
            PlanningError: The targets of a leader contradict each other.
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
            if low[leader] > high[leader] + MIMIC_TOLERANCE:
                raise PlanningError(
                    ErrorCode.INVALID_GOAL_CONSTRAINTS,
                    f"goal: joint '{name}' at {value:.4f} requires "
                    f"'{leader}', which it mimics, at {mimic.leader_position(value):.4f}; the goal also requires a "
                    f"different position of '{leader}'; choose consistent positions or omit mimic joints",
                )
        clipped = {name: max(low[name], min(target, high[name])) for name, target in targets.items()}
        return JointGoal(
            clipped,
            {name: max(target - low[name], 0.0) for name, target in clipped.items()},
            {name: max(high[name] - target, 0.0) for name, target in clipped.items()},
        )


@dataclass(frozen=True, slots=True, eq=False)
class PoseGoal:
    """Target pose of a link in the planning frame.

    Attributes:
        link: Name of the link.
        target: Target pose of the link.
        allowed: Region of accepted poses; None for the target only.
        carried: Pose in the link of the frame that the client moves, such as a subframe of a held object; None for the
            link's own frame.
    """

    link: str
    target: Transform
    allowed: KinematicConstraints | None = None
    carried: Transform | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintGoal:
    """Any state that satisfies the constraints."""

    constraints: KinematicConstraints


@dataclass(frozen=True, slots=True)
class SamplingSettings:
    """Parameters below ~ompl.

    Attributes:
        simplify_solutions: Whether planned paths are shortened.
    """

    simplify_solutions: bool = True


@dataclass(frozen=True, slots=True)
class PipelineSettings:
    """Settings of a pipeline, named after the parameters in a MoveIt config package.

    Attributes:
        start_state_max_bounds_error: Maximum bounds violation at the start that is corrected [rad or m].
        start_state_max_dt: Maximum duration of the motion from an out-of-bounds start to the bounds [s].
        jiggle_fraction: Search range for a free start around a colliding start, as a fraction of the joint ranges.
        max_sampling_attempts: Maximum number of states tried around a colliding start.
        start_state_collision_depth: Maximum penetration depth at the start that is corrected [m].
        start_state_contact_tolerance: Tolerated penetration depth of an attached object at the start [m].
        search_step: Maximum joint displacement between collision checks of a search [rad or m].
        motion_step: Maximum joint displacement between constraint checks of a motion [rad or m]; collision checks of
            the returned motion use `finest_step`.
        blend_deviation: Maximum distance between a waypoint and its blend [rad or m].
        default_workspace_bounds: Edge length of the default workspace cube [m].
        planner_configs: Named planner configurations.
        groups: Parameters of the pipeline, keyed by group.
        parameters: All parameters below the pipeline's name.
        robot_planning: Parameters of robot_description_planning (joint_limits, cartesian_limits, ...).
        seed: Random seed of every plan; None for a new seed per plan.
        seeded_iterations: Iteration limit of anytime planners if a seed is set.
        search_threads: Number of parallel RRTConnect searches per request; 0 for automatic.
        sampling: Settings of sampling-based planners.
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
        """Joint displacement between collision checks of the final validation [rad or m]."""
        return self.motion_step / CHECKS_PER_MOTION_STEP

    def default_planner(self, group: str) -> str:
        """Returns the default planner of a group, empty if no parameter sets it.

        MoveIt's Setup Assistant writes `None` for a group without a default planner.
        """
        candidates = (self.groups.get(group, {}).get(DEFAULT_PLANNER), self.parameters.get(DEFAULT_PLANNER))
        return next((str(name) for name in candidates if name and name != "None"), "")


@dataclass(frozen=True, slots=True, eq=False)
class Workspace:
    """Bounding box of a moving base: lower and upper corner in the planning frame, each of shape (3,) [m]."""

    lower: Array
    upper: Array


def group_bounds(model: RobotModel, group: JointGroup, workspace: Workspace | None) -> tuple[Array, Array]:
    """Returns the lower and upper bounds of a group's joints, each of shape (joints,) [rad or m].

    Args:
        model: Robot model.
        group: Joints of the planning group.
        workspace: Bounds of a planar or floating base that the group moves, as in MoveIt; None for no bounds.
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
    """Point "center" or "interim" of a circular motion in the planning frame, shape (3,) [m]."""

    name: str
    position: Array


@dataclass(frozen=True, slots=True, eq=False)
class PlanningRequest:
    """A planning request.

    Attributes:
        scene: Planning scene with the start positions and the attached objects.
        group: Name of the planning group.
        goals: Alternative goals.
        pipeline_id, planner_id: Names of pipeline and planner; empty for the defaults.
        attempts: Number of searches; the shortest path is returned.
        allowed_time_s: Allowed planning time [s].
        velocity_scaling, acceleration_scaling: Fractions of the joint limits; 0 for the defaults.
        cancelled: Returns True to cancel the request.
        start_velocities: Known joint velocities at the start [rad/s or m/s].
        path_constraints: Constraints of every state of the motion.
        max_cartesian_speed: Speed limit of `cartesian_speed_limited_link` [m/s]; 0 for no limit.
        workspace: Bounds of a moving base.
        seed: Random seed; None for the seed of the pipeline.
        max_iterations: Iteration limit of a search; None to limit only the time.
        auxiliary_point: Auxiliary point of a circular motion.
    """

    scene: PlanningScene
    group: str
    goals: tuple[JointGoal | PoseGoal | ConstraintGoal, ...]
    _: KW_ONLY
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
    max_iterations: int | None = None
    auxiliary_point: AuxiliaryPoint | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlanningResult:
    """A validated motion.

    Attributes:
        trajectory: Timed motion.
        start, goal: Positions of the whole robot at both ends [rad or m].
        path: Vertices of the shortened path, shape (n, joints).
        planner_id: Name of the planner.
        planning_time_s: Duration of the search [s].
        total_time_s: Duration including time parameterization and validation [s].
        statistics: Durations and check counts of the planning phases.
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
        """Durations of the planning phases [s]."""
        return self.statistics.phases_s
