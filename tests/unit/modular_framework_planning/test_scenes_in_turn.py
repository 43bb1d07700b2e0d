# SPDX-License-Identifier: BSD-3-Clause
"""What is kept of one scene for the next ones never changes what is said of them; judged by plain Coal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
from plain_coal_checker import PlainCoalChecker
from wide_robots import robot as wide_robot

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.geometry.shapes import Mesh
from modular_framework_planning.planning_scene.allowed_collisions import AllowedCollisionMatrix
from modular_framework_planning.planning_scene.padding import Padding
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_testing.planning.collision_worlds import random_state, shape_of

CHANGES, STATES = 150, 12
NEAR = 0.001  # [m]; of contact, where the two checkers may say something else
NAMES = ("one", "two", "three", "four", "five", "left_wrist")
MOVING = ("left_pan", "left_lift", "left_elbow")
Change = Callable[[PlanningScene, np.random.Generator], PlanningScene]


def near_the_arms(rng: np.random.Generator) -> pin.SE3:
    turn = pin.exp3(rng.normal(size=3))
    return pin.SE3(turn, np.array([rng.uniform(0.1, 0.9), rng.uniform(-0.9, 0.9), rng.uniform(0.3, 1.6)]))


def put(scene: PlanningScene, rng: np.random.Generator) -> PlanningScene:
    """An object of one or two shapes of any kind, or another one in place of that of its name."""
    shapes = [
        (shape_of(int(rng.integers(5)), rng.uniform(0.1, 0.4, 3))[0], pin.SE3(np.eye(3), rng.uniform(-0.1, 0.1, 3)))
        for _ in range(rng.integers(1, 3))
    ]
    name = rng.choice([name for name in NAMES if not scene.model.has_link(name)])
    return scene.with_object(CollisionObject(str(name), near_the_arms(rng), tuple(shapes)))


def move(scene: PlanningScene, rng: np.random.Generator) -> PlanningScene:
    return scene.with_object_moved(str(rng.choice([*scene.objects])), near_the_arms(rng)) if scene.objects else scene


def remove(scene: PlanningScene, rng: np.random.Generator) -> PlanningScene:
    return scene.without_object(str(rng.choice([*scene.objects]))) if scene.objects else scene


def hold(scene: PlanningScene, rng: np.random.Generator) -> PlanningScene:
    if scene.attached:
        return scene.with_detached(next(iter(scene.attached)))
    shape = shape_of(int(rng.integers(5)), rng.uniform(0.05, 0.2, 3))[0]
    body = CollisionObject(
        str(rng.choice(["held", "one"])), pin.SE3(np.eye(3), np.array([0.15, 0, 0])), ((shape, pin.SE3.Identity()),)
    )
    touch = frozenset(link for link in scene.model.document.links if link.startswith("left") and rng.random() < 0.7)
    return scene.with_attached(AttachedObject(body, str(rng.choice(["left_tool", "right_tool"])), touch))


def allow(scene: PlanningScene, rng: np.random.Generator) -> PlanningScene:
    pair = rng.choice([*NAMES[:5], "held", "left_upper", "left_fore", "right_fore"], 2, replace=False).tolist()
    return scene.with_acm(scene.acm.with_entry(*pair, bool(rng.random() < 0.7)))


def allow_by_default(scene: PlanningScene, rng: np.random.Generator) -> PlanningScene:
    return scene.with_acm(
        scene.acm.with_defaults({str(rng.choice([*NAMES[:5], "left_upper"])): bool(rng.random() < 0.7)})
    )


def forget_what_is_allowed(scene: PlanningScene, _: np.random.Generator) -> PlanningScene:
    return scene.with_acm(AllowedCollisionMatrix() if len(scene.acm.entries) > 4 else empty_scene(scene.model).acm)


def pad(scene: PlanningScene, rng: np.random.Generator) -> PlanningScene:
    links = {"left_fore": float(rng.choice([0.0, 0.05])), "right_upper": 0.02}
    return scene.with_padding(Padding(links if rng.random() < 0.5 else {}, {}, float(rng.choice([0.0, 0.03])), 0.01))


CHOICES: tuple[Change, ...] = (put, put, move, move, remove, hold, allow, allow_by_default, forget_what_is_allowed, pad)


def counts_of_verdicts(scene: PlanningScene, moving: np.ndarray | None, rng: np.random.Generator) -> np.ndarray:
    """How many random states are free, how many touch, and of how many plain Coal says something else.

    Plain Coal sees no inside of a mesh: where there is one, what it calls free and we do not is not counted.
    """
    ours, plain, counts = ExactCollisionChecker(scene, moving), PlainCoalChecker(scene, moving), np.zeros(3, dtype=int)
    fresh = ExactCollisionChecker(replace(scene, model=wide_robot()), moving)  # nothing is kept for this model
    has_mesh = any(isinstance(shape, Mesh) for body in scene.objects.values() for shape, _ in body.shapes)
    for _ in range(STATES):
        state = random_state(scene.model, rng)
        free, is_near = ours.is_free(state), abs(plain.distance(state)) < NEAR
        assert free == fresh.is_free(state)
        counts[0 if free else 1] += 1
        counts[2] += free != plain.is_free(state) and not is_near and (free or not has_mesh)
    assert ours.most_frequent_contact() == fresh.most_frequent_contact()
    return counts


def test_every_scene_is_judged_for_itself() -> None:
    rng = np.random.default_rng(5)
    model = wide_robot()
    scene, total = empty_scene(model), np.zeros(3, dtype=int)
    some = np.array([model.joint_names.index(name) for name in MOVING])
    for number in range(CHANGES):
        scene = rng.choice(CHOICES)(scene, rng)
        total += counts_of_verdicts(scene, some if number % 3 == 0 else None, rng)
    free, touching, wrong = total
    assert wrong == 0 and min(free, touching) > 0.1 * (free + touching)
