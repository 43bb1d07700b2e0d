# SPDX-License-Identifier: BSD-3-Clause
"""Finds pairs of links that need no collision check by sampling, with the reasons of the MoveIt Setup Assistant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.creation.collision_sampling import CollisionSampling, Pair, pair_of

ALWAYS_FRACTION = 0.95
"""Minimum fraction of samples in collision of a pair that counts as always in collision."""
BLOCK_SIZE = 250
SEARCH_STATES, SEARCH_STARTS, SEARCH_STEPS = 60, 4, 60
FIRST_STEP, LAST_STEP = 0.3, 0.01  # step sizes of the search, as fractions of a joint's range

Progress = Callable[[float], None]
"""Function called with the completed fraction, 0 to 1."""


@dataclass(frozen=True, slots=True)
class PairVerdict:
    """Result for a pair of links.

    Attributes:
        pair: Link names.
        reason: Adjacent, Default, Always or Never; "" if the pair must be checked.
        collision_fraction: Fraction of the samples in collision.
    """

    pair: Pair
    reason: str
    collision_fraction: float


@dataclass(frozen=True, slots=True, eq=False)
class Hand:
    """A gripper whose links may touch each other.

    Attributes:
        links: Links of the palm and the fingers.
        states: Joint positions of the robot with the gripper open and closed, shape (joints,) each [rad or m].
    """

    links: frozenset[str]
    states: tuple[Array, ...]


def find_verdicts(
    model: RobotModel, hands: Sequence[Hand], samples: int, seed: int, progress: Progress
) -> tuple[PairVerdict, ...]:
    """Decides for each pair of links whether collision checks are needed.

    Random states reveal most pairs that can collide. For the other pairs, a descent in distance starts from the closest
    of some states; only pairs without any collision are Never. Default applies to links of a gripper that touch in the
    open or closed state. Collisions in an arm's zero state are not accepted, because the arm need not start there.

    Args:
        model: Robot model.
        hands: Grippers of the robot.
        samples: Number of random states.
        seed: Seed of the random generator.
        progress: Function called with the completed fraction.

    Returns:
        One result per pair of links with shapes, in alphabetical order.
    """
    sampling = CollisionSampling(model)
    random = np.random.default_rng(seed)
    adjacent = adjacent_pairs(model, {link for pair in sampling.pairs for link in pair})
    default = {
        pair for hand in hands for state in hand.states for pair in sampling.colliding(state) if hand.links >= set(pair)
    }
    open_pairs = [pair for pair in sampling.pairs if pair not in adjacent]
    fractions = _sample(sampling, open_pairs, samples, random, lambda fraction: progress(0.7 * fraction))
    unseen = [pair for pair in open_pairs if fractions[pair] == 0.0 and pair not in default]
    colliding = set()
    for index, pair in enumerate(unseen):
        if _search(sampling, pair, random):
            colliding.add(pair)
        progress(0.7 + 0.3 * (index + 1) / len(unseen))
    progress(1.0)

    def reason(pair: Pair) -> str:
        if pair in adjacent:
            return "Adjacent"
        if pair in default:
            return "Default"
        if fractions[pair] > ALWAYS_FRACTION:
            return "Always"
        return "Never" if fractions[pair] == 0.0 and pair not in colliding else ""

    return tuple(PairVerdict(pair, reason(pair), fractions.get(pair, 0.0)) for pair in sorted(sampling.pairs))


def adjacent_pairs(model: RobotModel, links: set[str]) -> set[Pair]:
    """Returns the pairs of a link and its closest ancestor with a shape, with at most one movable joint between them.

    Args:
        model: Robot model.
        links: Links with shapes.
    """
    pairs = set()
    for link in links:
        moving = 0
        for joint, ancestor in model.tree.up(link):
            moving += model.document.joint_kinds[joint] != "fixed"
            if moving < 2 and ancestor in links:
                pairs.add(pair_of(link, ancestor))
            if moving == 2 or ancestor in links:
                break
    return pairs


def _sample(
    sampling: CollisionSampling, pairs: list[Pair], samples: int, random: np.random.Generator, progress: Progress
) -> dict[Pair, float]:
    """Returns the fraction of random states in which each pair collides.

    A pair with collisions in at most half of the states so far is not checked further; its fraction refers to these
    states.
    """
    counts, checked = dict.fromkeys(pairs, 0), dict.fromkeys(pairs, 0)
    active = pairs
    for start in range(0, samples, BLOCK_SIZE):
        sampling.watch(active)
        states = sampling.random_states(random, min(BLOCK_SIZE, samples - start))
        for state in states:
            for pair in sampling.colliding(state):
                counts[pair] += 1
        for pair in active:
            checked[pair] += len(states)
        active = [pair for pair in active if counts[pair] == 0 or counts[pair] > 0.5 * checked[pair]]
        progress((start + len(states)) / samples)
    return {pair: counts[pair] / max(checked[pair], 1) for pair in pairs}


def _search(sampling: CollisionSampling, pair: Pair, random: np.random.Generator) -> bool:
    """Returns whether a descent from the closest of some random states finds a collision of two links."""
    joints = _joints_between(sampling.model, pair)
    if not len(joints):
        return sampling.distance(pair, sampling.model.default_positions()) <= 0.0
    states = sampling.random_states(random, SEARCH_STATES)
    distances = [sampling.distance(pair, state) for state in states]
    for index in np.argsort(distances)[:SEARCH_STARTS]:
        if _descend(sampling, pair, states[index], distances[index], joints=joints, random=random):
            return True
    return False


def _descend(
    sampling: CollisionSampling,
    pair: Pair,
    state: Array,
    distance: float,
    *,
    joints: Array,
    random: np.random.Generator,
) -> bool:
    lower, upper = sampling.bounds()
    for step in np.geomspace(FIRST_STEP, LAST_STEP, SEARCH_STEPS):
        if distance <= 0.0:
            return True
        candidate = state.copy()
        candidate[joints] += step * (upper - lower)[joints] * random.standard_normal(len(joints))
        candidate = sampling.model.with_mimics(np.clip(candidate, lower, upper))
        candidate_distance = sampling.distance(pair, candidate)
        if candidate_distance < distance:
            state, distance = candidate, candidate_distance
    return distance <= 0.0


def _joints_between(model: RobotModel, pair: Pair) -> Array:
    """Returns the indices of the joints that determine the relative pose of two links, including leading joints."""
    first, second = ({joint for joint, _ in model.tree.up(link)} for link in pair)
    names, mimics = first ^ second, model.document.mimics
    names |= {mimics[name].leader for name in names if name in mimics}
    return np.array(sorted(model.index[name] for name in names if name in model.index), dtype=np.int64)
