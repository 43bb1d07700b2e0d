# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs of links need no collision check, found by samples, with the reasons of the MoveIt Setup Assistant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.creation.collision_sampling import CollisionSampling, Pair, pair_of

ALWAYS_SHARE = 0.95
"""A pair in collision in a larger share of the samples is taken to collide always."""
BLOCK = 250
SEARCH_STATES, SEARCH_STARTS, SEARCH_STEPS = 60, 4, 60
FIRST_STEP, LAST_STEP = 0.3, 0.01  # of the search, as a share of a joint's range

Progress = Callable[[float], None]
"""Takes the share that is done."""


@dataclass(frozen=True, slots=True)
class PairVerdict:
    """What is known of two links.

    Attributes:
        pair: their names.
        reason: Adjacent, Default, Always or Never; empty when they must be checked.
        share: of the samples in which they collided.
    """

    pair: Pair
    reason: str
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class Hand:
    """A gripper whose links may touch each other.

    Attributes:
        links: its palm and its fingers.
        states: of the robot, with the gripper open and closed.
    """

    links: frozenset[str]
    states: tuple[Array, ...]


def find_verdicts(
    model: RobotModel, hands: Sequence[Hand], samples: int, seed: int, progress: Progress
) -> tuple[PairVerdict, ...]:
    """Finds what is to be done with each pair of links.

    Random states show most pairs that can collide. Those they do not show are searched for: from the closest of some
    states, downhill in distance. Only pairs that neither finds are called Never. Default is for links of a gripper that
    touch when it is open or closed: the zero state of an arm is none it has to start in, so it excuses no collision.

    Args:
        model: of the robot.
        hands: its grippers.
        samples: random states.
        seed: of the random generator.
        progress: called with the share that is done.

    Returns:
        One verdict a pair of links that have shapes, in alphabetical order.
    """
    sampling = CollisionSampling(model)
    random = np.random.default_rng(seed)
    adjacent = adjacent_pairs(model, {link for pair in sampling.pairs for link in pair})
    default = {
        pair for hand in hands for state in hand.states for pair in sampling.colliding(state) if hand.links >= set(pair)
    }
    open_pairs = [pair for pair in sampling.pairs if pair not in adjacent]
    shares = _sample(sampling, open_pairs, samples, random, lambda share: progress(0.7 * share))
    unseen = [pair for pair in open_pairs if shares[pair] == 0.0 and pair not in default]
    found = set()
    for number, pair in enumerate(unseen):
        if _search(sampling, pair, random):
            found.add(pair)
        progress(0.7 + 0.3 * (number + 1) / len(unseen))
    progress(1.0)

    def reason(pair: Pair) -> str:
        if pair in adjacent:
            return "Adjacent"
        if pair in default:
            return "Default"
        if shares[pair] > ALWAYS_SHARE:
            return "Always"
        return "Never" if shares[pair] == 0.0 and pair not in found else ""

    return tuple(PairVerdict(pair, reason(pair), shares.get(pair, 0.0)) for pair in sorted(sampling.pairs))


def adjacent_pairs(model: RobotModel, links: set[str]) -> set[Pair]:
    """Returns the pairs of which one link is the next with a shape above the other, at most one joint away."""
    document = model.document
    above = {child: (document.joint_parents[joint], joint) for joint, child in document.joint_children.items()}
    found = set()
    for link in links:
        moving, upper = 0, link
        while upper in above and moving < 2:
            upper, joint = above[upper]
            moving += document.joint_kinds[joint] != "fixed"
            if upper in links:
                if moving < 2:
                    found.add(pair_of(link, upper))
                break
    return found


def _sample(
    sampling: CollisionSampling, pairs: list[Pair], samples: int, random: np.random.Generator, progress: Progress
) -> dict[Pair, float]:
    """Returns in what share of random states each pair collides.

    A pair that has been seen in collision and free is settled, and checked no more: its share is that until then.
    """
    counts, checked = dict.fromkeys(pairs, 0), dict.fromkeys(pairs, 0)
    active = pairs
    for begin in range(0, samples, BLOCK):
        sampling.watch(active)
        states = sampling.random_states(random, min(BLOCK, samples - begin))
        for state in states:
            for pair in sampling.colliding(state):
                counts[pair] += 1
        for pair in active:
            checked[pair] += len(states)
        active = [pair for pair in active if counts[pair] == 0 or counts[pair] > 0.5 * checked[pair]]
        progress((begin + len(states)) / samples)
    return {pair: counts[pair] / max(checked[pair], 1) for pair in pairs}


def _search(sampling: CollisionSampling, pair: Pair, random: np.random.Generator) -> bool:
    """Searches for a state in which two links touch, from the closest of some random states."""
    joints = _joints_between(sampling.model, pair)
    if not len(joints):
        return sampling.distance(pair, sampling.model.default_positions()) <= 0.0
    states = sampling.random_states(random, SEARCH_STATES)
    distances = [sampling.distance(pair, state) for state in states]
    for number in np.argsort(distances)[:SEARCH_STARTS]:
        if _descend(sampling, pair, states[number], distances[number], joints, random):
            return True
    return False


def _descend(
    sampling: CollisionSampling,
    pair: Pair,
    state: Array,
    distance: float,
    joints: Array,
    random: np.random.Generator,
) -> bool:
    lower, upper = sampling.bounds()
    for step in np.geomspace(FIRST_STEP, LAST_STEP, SEARCH_STEPS):
        if distance <= 0.0:
            return True
        other = state.copy()
        other[joints] += step * (upper - lower)[joints] * random.standard_normal(len(joints))
        other = sampling.model.with_mimics(np.clip(other, lower, upper))
        nearer = sampling.distance(pair, other)
        if nearer < distance:
            state, distance = other, nearer
    return distance <= 0.0


def _joints_between(model: RobotModel, pair: Pair) -> Array:
    """Returns the indices of the joints that move two links against each other, leaders of mimic joints included."""
    document = model.document
    above = {child: (document.joint_parents[joint], joint) for joint, child in document.joint_children.items()}
    ways: list[set[str]] = []
    for link in pair:
        way = set()
        while link in above:
            link, joint = above[link]
            way.add(joint)
        ways.append(way)
    names = ways[0] ^ ways[1]
    names |= {document.mimics[name].leader for name in names if name in document.mimics}
    return np.array(sorted(model.index[name] for name in names if name in model.index), dtype=np.int64)
