# SPDX-License-Identifier: BSD-3-Clause
"""Named states to begin with: an arm that reaches out with its tool down, and a gripper that is open or closed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.creation.collision_sampling import CollisionSampling, Pair, pair_of
from modular_framework_setup.creation.finger_shapes import finger_of, link_points, with_gripper
from modular_framework_setup.creation.robot_parts import Arm, Gripper

TOUCHING_M = 5.0e-4
"""Fingers this close hold nothing between them."""
TIP_SHARE = 0.9
"""A link that reaches this share of the furthest one's way out of the palm belongs to the tips."""
STATES, STEPS, POSES = 2000, 600, 21
REACH_SHARE, HEIGHT_SHARE = 0.55, 0.35
"""Where the tip is held, in front of the base and above it, as shares of how far the arm reaches."""


def gripper_states(sampling: CollisionSampling, gripper: Gripper) -> tuple[float, float]:
    """Returns the positions of the driver in which the gripper is open, and in which its fingers meet [rad or m]."""
    model = sampling.model
    number = model.joint_index(gripper.driver)
    lower, upper = (bound[number] for bound in sampling.bounds())
    pairs = _tip_pairs(sampling, gripper, 0.5 * (lower + upper))
    if not pairs:
        return float(upper), float(lower)

    def gap(position: float) -> float:
        state = with_gripper(model, model.default_positions(), gripper, position)
        return sampling.least_distance(pairs, state)

    positions = np.linspace(lower, upper, POSES)
    gaps = np.array([gap(position) for position in positions])
    if gaps[0] > gaps[-1]:
        positions, gaps = positions[::-1], gaps[::-1]
    apart = np.flatnonzero(gaps > TOUCHING_M)
    return float(positions[-1]), float(positions[max(apart[0] - 1, 0)] if len(apart) else positions[0])


def _tip_pairs(sampling: CollisionSampling, gripper: Gripper, position: float) -> list[Pair]:
    """Returns the pairs of links of different fingers that reach furthest from the palm, where objects are held."""
    points = link_points(sampling.model, gripper, position)
    reach = {link: float(np.linalg.norm(items, axis=1).max()) for link, items in points.items()}
    furthest = max(reach.values(), default=0.0)
    fingers = {link: finger_of(sampling.model, gripper, link) for link in reach if reach[link] >= TIP_SHARE * furthest}
    return [
        pair
        for pair in sampling.pairs
        if all(link in fingers for link in pair) and fingers[pair[0]] != fingers[pair[1]]
    ]


def ready_state(
    sampling: CollisionSampling, arm: Arm, approach: Array, start: Array, disabled: Iterable[Pair], seed: int
) -> Array:
    """Returns a state without collisions in which the tip of an arm is in front of its base, its approach axis down.

    Args:
        sampling: of the robot.
        arm: to be placed.
        approach: axis of the tip's frame that points out of the tool, shape (3,).
        start: positions of the other joints.
        disabled: pairs that may touch.
        seed: of the random generator.
    """
    model, random = sampling.model, np.random.default_rng(seed)
    indices = np.array([model.joint_index(name) for name in arm.joints])
    lower, upper = (bound[indices] for bound in sampling.bounds())
    sampling.watch(set(sampling.pairs) - {pair_of(*pair) for pair in disabled})
    pose = _PoseCost(model, arm, approach, start, indices)
    sampled = min(random.uniform(lower, upper, size=(STATES, len(indices))), key=pose.cost)
    found = []
    for begin in (0.5 * (lower + upper), sampled):
        best, cost, is_free = begin, pose.cost(begin), not sampling.colliding(pose.state(begin))
        for step in np.geomspace(0.2, 0.002, STEPS):
            other = np.clip(best + step * (upper - lower) * random.standard_normal(len(indices)), lower, upper)
            other_cost = pose.cost(other)
            if other_cost < cost or not is_free:
                other_is_free = not sampling.colliding(pose.state(other))
                if other_is_free or (not is_free and other_cost < cost):
                    best, cost, is_free = other, other_cost, other_is_free
        found.append((not is_free, cost, best))
    return pose.state(np.round(min(found, key=lambda item: item[:2])[2], 3))


class _PoseCost:
    """How far a state is from one to begin with."""

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
        numbers = [self._model.pin_model.getJointId(name) for name in arm.joints]
        points = [self._data.oMi[number].translation for number in numbers] + [self._data.oMf[self._tip].translation]
        return float(sum(np.linalg.norm(b - a) for a, b in zip(points, points[1:], strict=False))) or 1.0

    def state(self, positions: Array) -> Array:
        """Returns the state of the whole robot with the arm at some positions."""
        state = self._start.copy()
        state[self._indices] = positions
        return self._model.with_mimics(state)

    def cost(self, positions: Array) -> float:
        """Returns the cost of positions of the arm; 0 for none."""
        pin.framesForwardKinematics(self._model.pin_model, self._data, self.state(positions))
        pose = self._data.oMf[self._tip]
        goal = self._base + self._reach * np.array([REACH_SHARE, 0.0, HEIGHT_SHARE])
        down = 1.0 + float((pose.rotation @ self._approach)[2])
        away = float(np.linalg.norm(pose.translation - goal)) / self._reach
        middle = float(np.mean(((positions - self._middle) / self._range) ** 2))
        return 2.0 * down + 2.0 * away + middle
