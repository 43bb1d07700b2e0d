# SPDX-License-Identifier: BSD-3-Clause
"""Computes named states: ``ready`` of an arm, with the tool pointing down, and ``open`` and ``closed`` of a gripper."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.creation.collision_sampling import CollisionSampling, Pair, pair_of
from modular_framework_setup.creation.finger_shapes import finger_of, link_points, with_gripper
from modular_framework_setup.creation.robot_parts import Arm, Gripper

CLOSED_GAP_M = 5.0e-4
"""Maximum distance between the fingers of a closed gripper [m]."""
TIP_FRACTION = 0.9
"""Minimum reach of a tip link, as a fraction of the maximum reach from the palm."""
STATES, STEPS, GRIPPER_SAMPLES = 2000, 600, 21
REACH_FRACTION, HEIGHT_FRACTION = 0.55, 0.35
"""Distance of the tip in front of and above the base, as fractions of the arm length."""


def gripper_states(sampling: CollisionSampling, gripper: Gripper) -> tuple[float, float]:
    """Returns the open and closed positions of a gripper's driven joint [rad or m]."""
    model = sampling.model
    index = model.joint_index(gripper.driver)
    lower, upper = (bound[index] for bound in sampling.bounds())
    pairs = _tip_pairs(sampling, gripper, 0.5 * (lower + upper))
    if not pairs:
        return float(upper), float(lower)

    positions = np.linspace(lower, upper, GRIPPER_SAMPLES)
    gaps = np.array([_gap(sampling, gripper, pairs, position) for position in positions])
    if gaps[0] > gaps[-1]:
        positions, gaps = positions[::-1], gaps[::-1]
    apart = np.flatnonzero(gaps > CLOSED_GAP_M)
    return float(positions[-1]), float(positions[max(apart[0] - 1, 0)] if len(apart) else positions[0])


def pad_travel(sampling: CollisionSampling, gripper: Gripper, opened: float, closed: float) -> float:
    """Returns how far a finger tip moves per unit of the driver joint [m/rad or m/m].

    Args:
        sampling: Collision model that measures the gap between the fingers.
        gripper: Gripper.
        opened: Position of the driver joint when open [rad or m].
        closed: Position of the driver joint when closed [rad or m].
    """
    pairs = _tip_pairs(sampling, gripper, 0.5 * (opened + closed))
    if not pairs or opened == closed:
        return 0.0
    wide, narrow = (_gap(sampling, gripper, pairs, position) for position in (opened, closed))
    children = sampling.model.document.joint_children
    moving_fingers = {finger_of(sampling.model, gripper, children[name]) for name in gripper.joints}
    return max(0.0, (wide - narrow) / min(2, len(moving_fingers)) / abs(opened - closed))


def _gap(sampling: CollisionSampling, gripper: Gripper, pairs: list[Pair], position: float) -> float:
    model = sampling.model
    return sampling.min_distance(pairs, with_gripper(model, model.default_positions(), gripper, position))


def _tip_pairs(sampling: CollisionSampling, gripper: Gripper, position: float) -> list[Pair]:
    """Returns the pairs of tip links of different fingers, between which objects are held."""
    points = link_points(sampling.model, gripper, position)
    reach = {link: float(np.linalg.norm(items, axis=1).max()) for link, items in points.items()}
    furthest = max(reach.values(), default=0.0)
    fingers = {
        link: finger_of(sampling.model, gripper, link) for link in reach if reach[link] >= TIP_FRACTION * furthest
    }
    return [
        pair
        for pair in sampling.pairs
        if all(link in fingers for link in pair) and fingers[pair[0]] != fingers[pair[1]]
    ]


def ready_state(
    sampling: CollisionSampling, arm: Arm, approach: Array, start: Array, *, disabled: Iterable[Pair], seed: int
) -> Array:
    """Returns collision-free joint positions with the arm's tip in front of the base and the approach axis down.

    Args:
        sampling: Collision checker of the robot.
        arm: Arm to move.
        approach: Approach axis in the tip frame, shape (3,).
        start: Joint positions of the robot, shape (joints,) [rad or m].
        disabled: Pairs of links that may touch.
        seed: Seed of the random generator.
    """
    model, random = sampling.model, np.random.default_rng(seed)
    indices = np.array([model.joint_index(name) for name in arm.joints])
    lower, upper = (bound[indices] for bound in sampling.bounds())
    sampling.watch(set(sampling.pairs) - {pair_of(*pair) for pair in disabled})
    pose = _PoseCost(model, arm, approach, start, indices)
    best_sample = min(random.uniform(lower, upper, size=(STATES, len(indices))), key=pose.cost)
    results = []
    for initial in (0.5 * (lower + upper), best_sample):
        best, cost, is_free = initial, pose.cost(initial), not sampling.colliding(pose.state(initial))
        for step in np.geomspace(0.2, 0.002, STEPS):
            candidate = np.clip(best + step * (upper - lower) * random.standard_normal(len(indices)), lower, upper)
            candidate_cost = pose.cost(candidate)
            if candidate_cost < cost or not is_free:
                candidate_is_free = not sampling.colliding(pose.state(candidate))
                if candidate_is_free or (not is_free and candidate_cost < cost):
                    best, cost, is_free = candidate, candidate_cost, candidate_is_free
        results.append((not is_free, cost, best))
    return pose.state(np.round(min(results, key=lambda item: item[:2])[2], 3))


class _PoseCost:
    """Cost of an arm's deviation from the ready pose."""

    def __init__(self, model: RobotModel, arm: Arm, approach: Array, start: Array, indices: Array) -> None:
        self._model, self._start, self._indices = model, start, indices
        self._approach = np.asarray(approach, dtype=float)
        self._data = model.pin_model.createData()
        self._tip, base = model.frame_ids[arm.tip], model.frame_ids[arm.base]
        pin.framesForwardKinematics(model.pin_model, self._data, start)
        self._base = self._data.oMf[base].translation.copy()
        self._middle = 0.5 * (model.lower + model.upper)[indices].clip(-np.pi, np.pi)
        self._range = np.clip(model.upper - model.lower, 1e-6, 2.0 * np.pi)[indices]
        self._reach = self._arm_length(arm)

    def _arm_length(self, arm: Arm) -> float:
        """Returns the sum of the distances from joint to joint and to the tip [m]."""
        joint_ids = [self._model.pin_model.getJointId(name) for name in arm.joints]
        points = [self._data.oMi[joint_id].translation for joint_id in joint_ids] + [
            self._data.oMf[self._tip].translation
        ]
        return float(sum(np.linalg.norm(b - a) for a, b in zip(points, points[1:], strict=False))) or 1.0

    def state(self, positions: Array) -> Array:
        """Returns the joint positions of the robot with the arm at the given positions [rad or m]."""
        state = self._start.copy()
        state[self._indices] = positions
        return self._model.with_mimics(state)

    def cost(self, positions: Array) -> float:
        """Returns the cost of the arm's joint positions [rad or m]; 0 is the ready pose at mid-range."""
        pin.framesForwardKinematics(self._model.pin_model, self._data, self.state(positions))
        pose = self._data.oMf[self._tip]
        goal = self._base + self._reach * np.array([REACH_FRACTION, 0.0, HEIGHT_FRACTION])
        tilt = 1.0 + float((pose.rotation @ self._approach)[2])
        distance = float(np.linalg.norm(pose.translation - goal)) / self._reach
        deviation = float(np.mean(((positions - self._middle) / self._range) ** 2))
        return 2.0 * tilt + 2.0 * distance + deviation
