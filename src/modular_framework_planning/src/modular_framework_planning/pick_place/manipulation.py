# SPDX-License-Identifier: BSD-3-Clause
"""Planning of a grasp or release: motion to the approach, straight approach, finger motion, straight retreat.

Picking and placing differ in the finger motion, the effect on the scene, and the allowed collisions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import pinocchio as pin

from modular_framework_planning.cartesian.cartesian_path import (
    StepCheck,
    StraightLine,
    collision_check,
    straight_line,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.contacts import ATTACHED, WORLD, describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.kinematics.pose_follower import PoseFollower
from modular_framework_planning.kinematics.solution_choice import first_free
from modular_framework_planning.pick_place.settings import PickPlaceSettings
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker, CollisionCheckerFactory
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import JointGoal, PlanningRequest, PlanningResult
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, SceneChange
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_planning.trajectory_processing.line_timing import time_line
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

CHECK_STEP = 0.004  # [rad or m]; distance between checked states
DISTANCE_TOLERANCE_M = 1.0e-6

Posture = Mapping[str, float]


def allow_contacts(scene: PlanningScene, links: Iterable[str], others: Iterable[str]) -> PlanningScene:
    """Returns the scene with contact allowed between two sets of bodies.

    Args:
        scene: Scene to start from.
        links: Links or objects of the first set.
        others: Links or objects of the second set.
    """
    acm, names = scene.acm, list(others)
    for link in links:
        for other in names:
            acm = acm.with_entry(link, other, True)
    return scene.with_acm(acm)


@dataclass(frozen=True, slots=True, eq=False)
class Translation:
    """A straight motion of the tip.

    Attributes:
        direction: Unit vector, shape (3,).
        in_tip: Whether the direction is in the tip's frame instead of the planning frame.
        desired_distance_m: Desired distance.
        min_distance_m: Minimum distance.
    """

    direction: Array
    in_tip: bool
    desired_distance_m: float
    min_distance_m: float

    def translated_pose(self, pose: Transform, distance_m: float) -> Transform:
        """Returns the pose moved along the direction by a distance, which may be negative."""
        step = (pose.rotation @ self.direction if self.in_tip else self.direction) * distance_m
        return pin.SE3(pose.rotation, pose.translation + step)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Manoeuvre:
    """A candidate grasp or release.

    Attributes:
        name: Name of the candidate.
        tip_pose: Pose of the end effector's parent link during the finger motion, in the planning frame.
        approach: Motion to the tip pose.
        retreat: Motion after the finger motion.
        allow: Scene change that allows contacts during approach, finger motion and retreat.
        effect: Scene change after the finger motion, which attaches or detaches the object.
        fingers_before: Finger positions before the approach, by joint name [rad or m]; empty for no motion.
        fingers_after: Finger positions after the finger motion, by joint name [rad or m]; empty for no motion.
        closing_in: Whether the approach continues until just before a contact.
        middle: Name of the stage with the finger motion.
    """

    name: str
    tip_pose: Transform
    approach: Translation
    retreat: Translation
    allow: SceneChange
    effect: SceneChange
    fingers_before: Posture = field(default_factory=dict)
    fingers_after: Posture = field(default_factory=dict)
    closing_in: bool = False
    middle: Literal["grasp", "release"] = "grasp"


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One motion of a manoeuvre, either of the arm or of the fingers.

    Attributes:
        name: Name of the stage.
        scene: Expected real scene at the start of the stage.
        change: Scene change for this stage only, used while monitoring the motion.
        motion: Trajectory of the arm, or None.
        fingers: Goal positions of the fingers, by joint name [rad or m].
        effect: Permanent change of the real scene after the stage, or None.
    """

    name: str
    scene: PlanningScene
    change: SceneChange
    motion: Trajectory | None = None
    fingers: Posture = field(default_factory=dict)
    effect: SceneChange | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """The planning group of the arm.

    Attributes:
        group: Planning group.
        link: Parent link of the end effector.
        solver: Inverse kinematics of the group.
        velocity: Velocity limits, shape (joints,) [rad/s or m/s].
        acceleration: Acceleration limits, shape (joints,) [rad/s^2 or m/s^2].
    """

    group: JointGroup
    link: str
    solver: InverseKinematics
    velocity: Array
    acceleration: Array


class ManoeuvrePlanner:
    """Plans manoeuvres in sequence within one deadline; not thread-safe."""

    def __init__(
        self,
        arm: Arm,
        plan: Callable[[PlanningRequest], PlanningResult],
        request: PlanningRequest,
        *,
        contact_tolerance_m: float,
        settings: PickPlaceSettings,
        new_checker: CollisionCheckerFactory = DEFAULT_CHECKER,
    ) -> None:
        """Stores the parts that all manoeuvres share.

        Args:
            arm: Planning group of the arm.
            plan: Function that plans the motion to the approach.
            request: Template request with scene, planner, allowed time and path constraints.
            contact_tolerance_m: Maximum depth of tolerated initial contacts of a held object.
            settings: Settings of pick and place.
            new_checker: Factory of collision checkers.
        """
        self._arm, self._plan, self._template = arm, plan, request
        self._tolerance_m, self._settings = contact_tolerance_m, settings
        self._new_checker = new_checker
        self._deadline_s = time.monotonic() + request.allowed_time_s
        self._constraints: KinematicConstraints | None = request.path_constraints

    @property
    def remaining_s(self) -> float:
        """Time until the deadline [s]."""
        return self._deadline_s - time.monotonic()

    def plan(self, manoeuvre: Manoeuvre, allowed_time_s: float) -> tuple[Stage, ...]:
        """Returns the stages of one manoeuvre.

        Args:
            manoeuvre: Candidate grasp or release.
            allowed_time_s: Time limit for planning the motion to the approach [s].

        Raises:
            PlanningError: A stage is infeasible; the reason names the stage.
        """
        scene = self._template.scene
        open_scene = manoeuvre.allow(self._with_fingers(scene, manoeuvre.fingers_before))
        failure: tuple[float, PlanningError] | None = None
        for values in self._reachable(manoeuvre, open_scene):
            try:
                approach, retreat = self._lines(manoeuvre, open_scene, values)
            except _LineTooShort as error:
                if failure is None or error.fraction > failure[0]:
                    failure = (error.fraction, error)
                continue
            to_approach = self._plan_to_approach(manoeuvre, approach[0], allowed_time_s)
            return self._stages(manoeuvre, open_scene, to_approach, approach, retreat)
        assert failure is not None, "_reachable raises if no arm configuration is free"
        raise failure[1]

    def _with_fingers(self, scene: PlanningScene, fingers: Posture) -> PlanningScene:
        return scene.with_positions(scene.model.merge(scene.positions, fingers)) if fingers else scene

    def _checkers(self, scene: PlanningScene) -> tuple[CollisionChecker, MotionChecker]:
        """Builds the checkers of a scene; existing shallow contacts of a held object are tolerated."""
        indices = self._arm.group.indices
        checker = self._new_checker(scene, indices)
        shallow = [
            item
            for item in checker.contacts(scene.positions, include_fixed=False)
            if {item.first.kind, item.second.kind} == {ATTACHED, WORLD} and item.depth <= self._tolerance_m
        ]
        if shallow:
            checker = self._new_checker(scene, indices, shallow)
        return checker, MotionChecker(checker, indices, scene.positions)

    def _step_check(self, scene: PlanningScene) -> StepCheck:
        """Returns a check of a step that finds violated path constraints, then collisions."""
        checker, motion = self._checkers(scene)
        collides = collision_check(checker, motion, CHECK_STEP)

        def check_step(before: Array, after: Array) -> str:
            full = motion.full_positions(after)
            if self._constraints is not None and not self._constraints.are_satisfied(full):
                return f"path constraints: {self._constraints.describe(full)}"
            return collides(before, after)

        return check_step

    def _reachable(self, manoeuvre: Manoeuvre, scene: PlanningScene) -> list[Array]:
        """Returns collision-free arm configurations at the grasp, nearest first; raises PlanningError."""
        arm = self._arm
        solutions = arm.solver.solutions(arm.link, manoeuvre.tip_pose, scene.positions)
        if not solutions:
            raise PlanningError(
                ErrorCode.NO_IK_SOLUTION,
                f"{manoeuvre.name}: reach: "
                + arm.solver.explain_unreachable(arm.link, manoeuvre.tip_pose, scene.positions),
            )
        at_nearest = scene.with_positions(solutions[0])
        checker, motion = self._checkers(at_nearest)
        collision_free = first_free(
            [item[arm.group.indices] for item in solutions],
            motion.state_is_free,
            self._settings.max_attempted_states_per_pose,
        )
        if not collision_free:
            raise PlanningError(
                ErrorCode.GOAL_IN_COLLISION,
                f"{manoeuvre.name}: reach: all {len(solutions)} inverse "
                "kinematics solutions collide; nearest solution: "
                f"{describe_contacts(checker.contacts(solutions[0], include_fixed=False))}",
            )
        return collision_free

    def _lines(self, manoeuvre: Manoeuvre, scene: PlanningScene, values: Array) -> tuple[Array, Array]:
        """Returns the joint vectors of the approach and of the retreat, shape (n, joints); raises _LineTooShort."""
        arm, pose = self._arm, manoeuvre.tip_pose
        at_grasp = scene.with_positions(self._full_positions(scene, values))
        translation, name = manoeuvre.approach, manoeuvre.name
        back = self._line(at_grasp, translation.translated_pose(pose, -translation.desired_distance_m))
        approach = _long_enough(f"{name}: approach (checked backwards from the grasp)", back, translation)[::-1]
        if manoeuvre.closing_in:
            untouched = self._with_fingers(self._template.scene, manoeuvre.fingers_before)
            further = self._line(
                untouched.with_positions(at_grasp.positions),
                translation.translated_pose(pose, translation.desired_distance_m),
            )
            approach = np.vstack([approach, further.rows[1:]])
            at_grasp = scene.with_positions(self._full_positions(scene, approach[-1]))
            pose = at_grasp.frame_transform(arm.link)
        held = self._after_fingers(manoeuvre, at_grasp)
        retreat = self._line(held, manoeuvre.retreat.translated_pose(pose, manoeuvre.retreat.desired_distance_m))
        return approach, _long_enough(f"{name}: retreat", retreat, manoeuvre.retreat)

    def _after_fingers(self, manoeuvre: Manoeuvre, at_grasp: PlanningScene) -> PlanningScene:
        """Returns the scene after the finger motion."""
        return manoeuvre.allow(manoeuvre.effect(self._with_fingers(at_grasp, manoeuvre.fingers_after)))

    def _full_positions(self, scene: PlanningScene, values: Array) -> Array:
        positions = scene.positions.copy()
        positions[self._arm.group.indices] = values
        return positions

    def _line(self, scene: PlanningScene, end: Transform) -> StraightLine:
        """Solves a straight line from the robot's pose in the scene."""
        return straight_line(
            PoseFollower(self._arm.solver, self._arm.link, scene.positions),
            [end],
            self._settings.cartesian_motion_step_size,
            check_step=self._step_check(scene),
        )

    def _plan_to_approach(self, manoeuvre: Manoeuvre, values: Array, allowed_time_s: float) -> Trajectory:
        """Plans from the robot's state to the start of the approach, without allowed contacts."""
        group, template = self._arm.group, self._template
        allowed_s = min(self.remaining_s, allowed_time_s)
        if allowed_s <= 0.0:
            raise PlanningError(
                ErrorCode.TIMED_OUT, f"{manoeuvre.name}: no time remains to plan the motion to the approach"
            )
        goal = JointGoal(dict(zip(group.joints, values.tolist(), strict=True)))
        try:
            return self._plan(replace(template, goals=(goal,), allowed_time_s=allowed_s)).trajectory
        except PlanningError as error:
            raise PlanningError(error.code, f"{manoeuvre.name}: motion to the approach: {error.reason}") from error

    def _stages(
        self, manoeuvre: Manoeuvre, open_scene: PlanningScene, to_approach: Trajectory, approach: Array, retreat: Array
    ) -> tuple[Stage, ...]:
        """Returns the stages in order, with timed lines; lines of zero length are left out."""
        allow, before = manoeuvre.allow, manoeuvre.fingers_before
        ready = open_scene.with_positions(self._full_positions(open_scene, approach[0]))
        at_grasp = open_scene.with_positions(self._full_positions(open_scene, approach[-1]))
        held = self._after_fingers(manoeuvre, at_grasp)
        stages = [Stage("plan", self._template.scene, _unchanged_scene, to_approach)]
        if before:
            stages.append(Stage("pre_grasp", ready, allow, fingers=before))
        if _has_motion(approach):
            stages.append(Stage("approach", ready, allow, self._timed_line(ready, approach)))
        stages.append(Stage(manoeuvre.middle, at_grasp, allow, None, manoeuvre.fingers_after, manoeuvre.effect))
        if _has_motion(retreat):
            stages.append(Stage("retreat", held, allow, self._timed_line(held, retreat)))
        return tuple(stages)

    def _timed_line(self, scene: PlanningScene, rows: Array) -> Trajectory:
        """Times a line that starts at the robot's state in the scene."""
        _, motion = self._checkers(scene)
        return time_line(
            self._arm.group.joints,
            rows,
            self._arm.velocity,
            self._arm.acceleration,
            lambda curve: motion.colliding_state(curve, CHECK_STEP) is None,
        )


def _has_motion(rows: Array) -> bool:
    return bool(np.abs(rows - rows[0]).max() > 0.0)


def _unchanged_scene(scene: PlanningScene) -> PlanningScene:
    return scene


class _LineTooShort(PlanningError):
    """A line ended before the minimum distance."""

    def __init__(self, reason: str, fraction: float) -> None:
        super().__init__(ErrorCode.PLANNING_FAILED, reason)
        self.fraction = fraction


def _long_enough(source_name: str, line: StraightLine, translation: Translation) -> Array:
    """Returns the joint vectors of a line; raises _LineTooShort if the line is shorter than the minimum distance."""
    distance = line.fraction * translation.desired_distance_m
    if distance < translation.min_distance_m - DISTANCE_TOLERANCE_M:
        raise _LineTooShort(
            f"{source_name}: only {distance:.3f} m of {translation.desired_distance_m:.3f} m; at least "
            f"{translation.min_distance_m:.3f} m are required; {line.stop}",
            line.fraction,
        )
    return line.rows
