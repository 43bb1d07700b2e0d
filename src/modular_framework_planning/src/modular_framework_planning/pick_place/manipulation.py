# SPDX-License-Identifier: BSD-3-Clause
"""Plans a grasp or a release: motion to the approach, straight approach, fingers, straight retreat.

Picking and placing differ in the motion of the fingers, the effect on the scene, and the allowed collisions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import pinocchio as pin

from modular_framework_planning.cartesian.cartesian_path import (
    Objection,
    StraightLine,
    collision_objection,
    straight_line,
)
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.contacts import ATTACHED, WORLD, describe_contacts
from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.kinematics.solution_choice import first_free
from modular_framework_planning.pick_place.settings import PickPlaceSettings
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker, CollisionCheckerFactory
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import JointGoal, PlanningAnswer, PlanningRequest
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, SceneChange
from modular_framework_planning.robot_model.robot_model import JointGroup
from modular_framework_planning.trajectory_processing.line_timing import time_line
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

CHECK_STEP = 0.004  # [rad or m] between checked states
DISTANCE_SLACK_M = 1.0e-6

Posture = Mapping[str, float]


def allowing(scene: PlanningScene, links: Iterable[str], others: Iterable[str]) -> PlanningScene:
    """Returns the scene in which each of the links (or bodies) may touch each of the others."""
    acm, names = scene.acm, list(others)
    for link in links:
        for other in names:
            acm = acm.with_entry(link, other, True)
    return scene.with_acm(acm)


@dataclass(frozen=True, slots=True, eq=False)
class Translation:
    """A straight motion of the tip.

    Attributes:
        direction: of unit length, shape (3,); in the tip's own frame if `in_tip`, else in the planning frame.
        desired_distance_m, min_distance_m: how far it should go, and how far it has to.
    """

    direction: Array
    in_tip: bool
    desired_distance_m: float
    min_distance_m: float

    def ending_at(self, pose: Transform, distance_m: float) -> Transform:
        """Returns the pose this far along the direction; a negative distance is before it."""
        step = (pose.rotation @ self.direction if self.in_tip else self.direction) * distance_m
        return pin.SE3(pose.rotation, pose.translation + step)


@dataclass(frozen=True, slots=True, eq=False)
class Manoeuvre:
    """One way to grasp or to release.

    Attributes:
        tip_pose: of the end effector's link while the fingers move, in the planning frame.
        allow: what may touch on the two lines and while the fingers move.
        effect: what becomes of the object when the fingers have moved: attached, or put into the world.
        fingers_before, fingers_after: positions of the gripper's joints; none: they stay.
        closing_in: continue along the approach until just before a contact.
        middle: name of the stage in which the fingers move.
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
    """One motion of a manoeuvre: a timed one of the arm, or one of the fingers.

    Attributes:
        scene: the real scene as it should be when the stage begins.
        change: what the stage allows for itself, to watch the motion with.
        effect: what the real scene becomes afterwards; None: it stays.
    """

    name: str
    scene: PlanningScene
    change: SceneChange
    motion: Trajectory | None = None
    fingers: Posture = field(default_factory=dict)
    effect: SceneChange | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """The group that moves, and its limits [rad/s, rad/s^2]."""

    group: JointGroup
    link: str
    solver: InverseKinematics
    velocity: Array
    acceleration: Array


class ManoeuvrePlanner:
    """Plans manoeuvres one after the other within one deadline. Not thread-safe."""

    def __init__(
        self,
        arm: Arm,
        plan: Callable[[PlanningRequest], PlanningAnswer],
        request: PlanningRequest,
        contact_tolerance_m: float,
        settings: PickPlaceSettings,
        new_checker: CollisionCheckerFactory = DEFAULT_CHECKER,
    ) -> None:
        """Stores what all manoeuvres share.

        Args:
            arm: the group that moves.
            plan: plans the way to the approach.
            request: a template of that plan: scene, planner, time allowed, path constraints.
            contact_tolerance_m: depth at which a held object may already touch something.
            settings: how finely lines are solved and how many postures are tried.
            new_checker: makes the collision checkers.
        """
        self._arm, self._plan, self._template = arm, plan, request
        self._tolerance_m, self._settings = contact_tolerance_m, settings
        self._new_checker = new_checker
        self._deadline_s = time.monotonic() + request.allowed_time_s
        self._constraints: KinematicConstraints | None = request.path_constraints

    @property
    def remaining_s(self) -> float:
        """Time that is left."""
        return self._deadline_s - time.monotonic()

    def plan(self, manoeuvre: Manoeuvre, allowed_time_s: float) -> tuple[Stage, ...]:
        """Returns the stages of one manoeuvre; the plan of the motion to its approach may take `allowed_time_s`.

        Raises:
            PlanningError: which stage cannot be done, and why.
        """
        scene = self._template.scene
        open_scene = manoeuvre.allow(self._with_fingers(scene, manoeuvre.fingers_before))
        failure: tuple[float, PlanningError] | None = None
        for values in self._reachable(manoeuvre, open_scene):
            try:
                approach, retreat = self._lines(manoeuvre, open_scene, values)
            except _LineTooShort as error:
                if failure is None or error.share > failure[0]:
                    failure = (error.share, error)
                continue
            to_approach = self._plan_to_approach(manoeuvre, approach[0], allowed_time_s)
            return self._stages(manoeuvre, open_scene, to_approach, approach, retreat)
        assert failure is not None, "there is at least one posture, or _reachable has raised"
        raise failure[1]

    def _with_fingers(self, scene: PlanningScene, fingers: Posture) -> PlanningScene:
        return scene.with_positions(scene.model.merge(scene.positions, fingers)) if fingers else scene

    def _checkers(self, scene: PlanningScene) -> tuple[CollisionChecker, MotionChecker]:
        """Builds the checkers of a scene; shallow contacts that a held object has there may stay."""
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

    def _objection(self, scene: PlanningScene) -> Objection:
        """Refuses contacts and broken path constraints."""
        checker, motion = self._checkers(scene)
        touches = collision_objection(checker, motion, CHECK_STEP)

        def objection(before: Array, after: Array) -> str:
            full = motion.full_positions(after)
            if self._constraints is not None and not self._constraints.satisfied(full):
                return f"path constraints: {self._constraints.describe(full)}"
            return touches(before, after)

        return objection

    def _reachable(self, manoeuvre: Manoeuvre, scene: PlanningScene) -> list[Array]:
        """Returns free postures of the arm at the grasp, nearest first; raises PlanningError."""
        arm = self._arm
        found = arm.solver.solutions(arm.link, manoeuvre.tip_pose, scene.positions)
        if not found:
            raise PlanningError(
                ErrorCode.NO_IK_SOLUTION,
                f"{manoeuvre.name}: reach: "
                + arm.solver.explain_unreachable(arm.link, manoeuvre.tip_pose, scene.positions),
            )
        at_nearest = scene.with_positions(found[0])
        checker, motion = self._checkers(at_nearest)
        free = first_free(
            [item[arm.group.indices] for item in found],
            motion.state_is_free,
            self._settings.max_attempted_states_per_pose,
        )
        if not free:
            raise PlanningError(
                ErrorCode.GOAL_IN_COLLISION,
                f"{manoeuvre.name}: reach: all {len(found)} inverse "
                "kinematics solutions collide; the nearest: "
                f"{describe_contacts(checker.contacts(found[0], include_fixed=False))}",
            )
        return free

    def _lines(self, manoeuvre: Manoeuvre, scene: PlanningScene, values: Array) -> tuple[Array, Array]:
        """Returns the rows of the approach and of the retreat; raises _LineTooShort."""
        arm, pose = self._arm, manoeuvre.tip_pose
        at_grasp = scene.with_positions(self._at(scene, values))
        translation, name = manoeuvre.approach, manoeuvre.name
        back = self._line(at_grasp, translation.ending_at(pose, -translation.desired_distance_m))
        approach = _enough(f"{name}: approach (looked at from the grasp backwards)", back, translation)[::-1]
        if manoeuvre.closing_in:
            untouched = self._with_fingers(self._template.scene, manoeuvre.fingers_before)
            further = self._line(
                untouched.with_positions(at_grasp.positions),
                translation.ending_at(pose, translation.desired_distance_m),
            )
            approach = np.vstack([approach, further.rows[1:]])
            at_grasp = scene.with_positions(self._at(scene, approach[-1]))
            pose = at_grasp.frame_transform(arm.link)
        held = self._after(manoeuvre, at_grasp)
        leave = self._line(held, manoeuvre.retreat.ending_at(pose, manoeuvre.retreat.desired_distance_m))
        return approach, _enough(f"{name}: retreat", leave, manoeuvre.retreat)

    def _after(self, manoeuvre: Manoeuvre, at_grasp: PlanningScene) -> PlanningScene:
        """Returns the scene when the fingers have moved."""
        return manoeuvre.allow(manoeuvre.effect(self._with_fingers(at_grasp, manoeuvre.fingers_after)))

    def _at(self, scene: PlanningScene, values: Array) -> Array:
        positions = scene.positions.copy()
        positions[self._arm.group.indices] = values
        return positions

    def _line(self, scene: PlanningScene, end: Transform) -> StraightLine:
        """Follows a line from where the robot is in the scene."""
        return straight_line(
            self._arm.solver,
            self._arm.link,
            scene.positions,
            [end],
            self._settings.cartesian_motion_step_size,
            objection=self._objection(scene),
        )

    def _plan_to_approach(self, manoeuvre: Manoeuvre, values: Array, allowed_time_s: float) -> Trajectory:
        """Plans from where the robot is to the start of the approach, with nothing allowed to touch."""
        group, template = self._arm.group, self._template
        allowed_s = min(self.remaining_s, allowed_time_s)
        if allowed_s <= 0.0:
            raise PlanningError(ErrorCode.TIMED_OUT, f"{manoeuvre.name}: no time is left to plan the way to it")
        goal = JointGoal(dict(zip(group.joints, values.tolist(), strict=True)))
        try:
            return self._plan(replace(template, goals=(goal,), allowed_time_s=allowed_s)).trajectory
        except PlanningError as error:
            raise PlanningError(error.code, f"{manoeuvre.name}: way to the approach: {error.reason}") from error

    def _stages(
        self, manoeuvre: Manoeuvre, open_scene: PlanningScene, to_approach: Trajectory, approach: Array, retreat: Array
    ) -> tuple[Stage, ...]:
        """Times the lines and puts everything in order; a line without length is left out."""
        allow, before = manoeuvre.allow, manoeuvre.fingers_before
        ready = open_scene.with_positions(self._at(open_scene, approach[0]))
        at_grasp = open_scene.with_positions(self._at(open_scene, approach[-1]))
        held = self._after(manoeuvre, at_grasp)
        stages = [Stage("plan", self._template.scene, _unchanged, to_approach)]
        if before:
            stages.append(Stage("pre_grasp", ready, allow, fingers=before))
        if _moves(approach):
            stages.append(Stage("approach", ready, allow, self._timed(ready, approach)))
        stages.append(Stage(manoeuvre.middle, at_grasp, allow, None, manoeuvre.fingers_after, manoeuvre.effect))
        if _moves(retreat):
            stages.append(Stage("retreat", held, allow, self._timed(held, retreat)))
        return tuple(stages)

    def _timed(self, scene: PlanningScene, rows: Array) -> Trajectory:
        """Times a line that begins where the robot is in the scene."""
        _, motion = self._checkers(scene)
        return time_line(
            self._arm.group.joints,
            rows,
            self._arm.velocity,
            self._arm.acceleration,
            lambda curve: motion.colliding_state(curve, CHECK_STEP) is None,
        )


def _moves(rows: Array) -> bool:
    return bool(np.abs(rows - rows[0]).max() > 0.0)


def _unchanged(scene: PlanningScene) -> PlanningScene:
    return scene


class _LineTooShort(PlanningError):
    """A line ended before its least distance."""

    def __init__(self, reason: str, share: float) -> None:
        super().__init__(ErrorCode.PLANNING_FAILED, reason)
        self.share = share


def _enough(what: str, line: StraightLine, translation: Translation) -> Array:
    """Returns the rows of a line that went far enough; raises _LineTooShort."""
    distance = line.fraction * translation.desired_distance_m
    if distance < translation.min_distance_m - DISTANCE_SLACK_M:
        raise _LineTooShort(
            f"{what}: only {distance:.3f} m of {translation.desired_distance_m:.3f} m, at least "
            f"{translation.min_distance_m:.3f} m are asked for; {line.stop}",
            line.fraction,
        )
    return line.rows
