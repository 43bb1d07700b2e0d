# SPDX-License-Identifier: BSD-3-Clause
"""Class of a failed episode, from its end, the reports of its components and the true states of its world."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum

import numpy as np

from mbf_method.errors import MethodFault
from modular_framework_benchmark.metrics.measurements import ComponentReport, EpisodeMeasurements
from modular_framework_benchmark.predicates.conditions import Untouched
from modular_framework_benchmark.predicates.predicate import Condition
from modular_framework_benchmark.predicates.world_track import ROBOT, Floats, WorldTrack
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_ros.reported_figures import (
    CANDIDATES,
    ERROR_CODE,
    METHOD_FAULT,
    PLANNER_FAULT,
    POLICY_FAULT,
    REACHABLE,
)

SLIP_HEIGHT_M = 0.05
"""Height above its start up to which a lost object has slipped; from higher, it was dropped [m]."""
RELEASE_S = 1.0
"""Time after the start of a gripper motion within which the loss of an object is its release [s]; the simulation
notices a loss after 0.3 s."""
AFTER_GENERATION = ("planning", "execution", "grasp", "policy")
"""Components that a task uses once it has a grasp."""
NO_IK_SOLUTION = -31
"""Error code of moveit_msgs/MoveItErrorCodes for a pose that the arm cannot reach."""


class FailureClass(Enum):
    """Class of a failed episode."""

    NO_CANDIDATE = "no candidate"  # the method found no grasp
    UNREACHABLE = "unreachable"  # no grasp or goal that the arm can reach
    NO_PLAN = "no plan"  # the last failure of the task was a plan
    COLLISION = "collision in execution"  # the robot touched something else, and a motion or an `untouched` failed
    MOTION = "motion not completed"  # a motion was not completed, without a contact in the record
    GRASP_MISSED = "grasp missed"  # the gripper closed, and never held the object
    SLIPPED = "slipped"  # the gripper lost the object near its start
    DROPPED = "dropped"  # the gripper lost the object higher above its start
    MISPLACED = "misplaced"  # the final position or orientation of the object is wrong
    TIMEOUT = "timeout"
    INVALID_OUTPUT = "invalid output"  # the method raised an exception, or its result is invalid
    DIED = "component died"
    INVALID = "invalid"


_DEATHS = (MethodFault.NOT_STARTED, MethodFault.DIED, MethodFault.LATE)
_OF_STATUS = {
    EpisodeStatus.INVALID: FailureClass.INVALID,
    EpisodeStatus.BROKEN: FailureClass.DIED,
    EpisodeStatus.TIMED_OUT: FailureClass.TIMEOUT,
}


def failure_class(
    episode: EpisodeMeasurements, task_succeeded: bool, conditions: Iterable[Condition] = ()
) -> FailureClass | None:
    """Returns the class of an episode; None for a success.

    The class names the end of the attempt: the loss of a held object unless the gripper opened on purpose, otherwise
    the last failure of a component, otherwise the final state of the world.

    Args:
        episode: Measurements of the episode.
        task_succeeded: Whether the task itself ended with success.
        conditions: Conditions of the success criteria.
    """
    if episode.status is EpisodeStatus.SUCCEEDED:
        return None
    if episode.status in _OF_STATUS:
        return _OF_STATUS[episode.status]
    grasps = [report for report in episode.reports if report.component == "grasp"]
    lost_m = _loss_height(episode.world, np.array([report.started_s for report in grasps]))
    if lost_m is not None:
        return FailureClass.SLIPPED if lost_m <= SLIP_HEIGHT_M else FailureClass.DROPPED
    failed = [report for report in episode.reports if not report.succeeded or _is_empty(report)]
    if not task_succeeded and failed:
        return _of_component(max(failed, key=lambda report: report.ended_s), episode)
    if not task_succeeded and not any(report.component in AFTER_GENERATION for report in episode.reports):
        return FailureClass.NO_CANDIDATE
    if episode.world is not None and _touched_untouched(conditions, episode.world):
        return FailureClass.COLLISION
    missed = grasps and episode.target and not _held_objects(episode.world)
    return FailureClass.GRASP_MISSED if missed else FailureClass.MISPLACED


def _touched_untouched(conditions: Iterable[Condition], world: WorldTrack) -> bool:
    """Returns whether a robot touched a model that had to stay untouched."""
    return any(
        isinstance(item, Untouched) and item.other == ROBOT and not item.satisfied_in(world)[-1:].all()
        for item in conditions
    )


def _held_objects(world: WorldTrack | None) -> set[str]:
    """Returns the names of the objects that a gripper has held."""
    return {name for name, held in world.held.items() if held.any()} if world is not None else set()


def _of_component(report: ComponentReport, episode: EpisodeMeasurements) -> FailureClass:
    fault = next(filter(None, map(report.figures.get, (METHOD_FAULT, PLANNER_FAULT, POLICY_FAULT))), None)
    if fault:
        return FailureClass.DIED if fault in _DEATHS else FailureClass.INVALID_OUTPUT
    if report.component == "generation":
        reachable = report.figures.get(REACHABLE)
        return FailureClass.UNREACHABLE if reachable == 0.0 and _found_any(report) else FailureClass.NO_CANDIDATE
    if report.component == "planning":
        out_of_reach = report.figures.get(ERROR_CODE) == NO_IK_SOLUTION
        return FailureClass.UNREACHABLE if out_of_reach else FailureClass.NO_PLAN
    if report.component == "grasp":
        return FailureClass.GRASP_MISSED
    return FailureClass.COLLISION if _robot_collided(report, episode) else FailureClass.MOTION


def _robot_collided(report: ComponentReport, episode: EpisodeMeasurements) -> bool:
    """Returns whether a robot touched anything during a motion except what it handles or touched at the start."""
    world = episode.world
    if world is None:
        return False
    handled = {episode.target, *_held_objects(world)}
    during = (world.times_s >= report.started_s) & (world.times_s <= report.ended_s)
    return any(
        bool(flags[during].any()) and not flags[0]
        for pair, flags in world.contacts.items()
        if pair & world.robots and not pair & handled
    )


def _is_empty(report: ComponentReport) -> bool:
    """Returns whether a generation found no grasp that the arm can reach."""
    return 0.0 in (report.figures.get(CANDIDATES), report.figures.get(REACHABLE))


def _found_any(report: ComponentReport) -> bool:
    return report.figures.get(CANDIDATES) != 0.0


def _loss_height(world: WorldTrack | None, gripper_motions_s: Floats) -> float | None:
    """Returns the height above its start at which the gripper lost an object for good [m]; None without a loss.

    Args:
        world: True states of the world.
        gripper_motions_s: Starts of the gripper's motions [s since the start of the recording].
    """
    last_loss: tuple[int, float] | None = None
    if world is None:
        return None
    for name in _held_objects(world):
        held = world.held[name]
        last = int(np.flatnonzero(held)[-1])
        if held[-1]:
            continue
        since_motion_s = world.times_s[last] - gripper_motions_s
        if np.any((since_motion_s >= 0.0) & (since_motion_s <= RELEASE_S)):
            continue
        heights = world.bodies[name].positions[:, 2]
        last_loss = max(last_loss or (-1, 0.0), (last, float(heights[last] - heights[0])))
    return None if last_loss is None else last_loss[1]
