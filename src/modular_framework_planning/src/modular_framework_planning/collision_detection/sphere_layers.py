# SPDX-License-Identifier: BSD-3-Clause
"""Measures which spheres make the collision checks of a robot fast; none where they are faster without.

Whether spheres pay depends on the robot and on the processor. Verdicts do not depend on them.
"""

from __future__ import annotations

import logging
import time
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from pinocchio import SE3 as Transform
from pinocchio import exp3

from modular_framework_planning.collision_detection.collision_bodies import placed_geometries, watched_pairs
from modular_framework_planning.collision_detection.collision_world import CompiledWorld, compile_world
from modular_framework_planning.collision_detection.kernels.compiled_edges import BLOCKED, FREE, GroupEdges, check_edges
from modular_framework_planning.collision_detection.reaches import farthest_end
from modular_framework_planning.collision_detection.sphere_covers import Layers
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel

LOGGER = logging.getLogger("rosout.collision_detection")
NO_LAYERS, ALL_LAYERS = Layers(0, 0), Layers(15, 2)
CHOICES = (NO_LAYERS, Layers(0, 2), Layers(15, 0), ALL_LAYERS)
DRAWN = 120  # states, and motions that start from those that are free
MOTIONS = 40  # that are free, and as many that touch a board: planners meet obstacles far more often than the robot
ROUNDS = 3  # of which the quickest one counts
LONGEST, STEP = 1.0, 0.02  # [rad or m]; of a motion in each joint, and between the samples on it
BOARDS, BOARD = 12, (0.5, 0.4, 0.02)  # around the robot; sizes [m]
NEAREST, FARTHEST = 0.3, 0.8  # of them from the robot, as shares of its reach
_chosen: WeakKeyDictionary[RobotModel, Layers] = WeakKeyDictionary()


def layers_for(model: RobotModel) -> Layers:
    """Returns the spheres that checks of a robot use: those that were chosen, or all."""
    return _chosen.get(model, ALL_LAYERS)


def choose_layers(model: RobotModel) -> Layers:
    """Measures random motions of a robot among boards, and chooses the spheres with which they are checked fastest.

    To be called when a process starts; takes a tenth of a second besides the loading of the meshes.
    """
    rng = np.random.default_rng(0)
    alone = _world(empty_scene(model), NO_LAYERS)
    scene = _among_boards(model, farthest_end(alone.world.tree, alone.world), rng)
    worlds = {layers: _world(scene, layers) for layers in CHOICES}
    motions = _motions(model, worlds[NO_LAYERS], alone, rng)
    times = {layers: min(_seconds(world, motions) for _ in range(ROUNDS)) for layers, world in worlds.items()}
    best = _chosen[model] = min(times, key=lambda layers: times[layers]) if motions.size else NO_LAYERS
    LOGGER.info(
        "collision checks of '%s' use %d spheres around and %d balls inside of each body: %.1f ms for %d motions, "
        "%.1f ms without",
        model.name,
        best.nodes,
        best.balls,
        1e3 * times[best],
        len(motions),
        1e3 * times[NO_LAYERS],
    )
    return best


def _world(scene: PlanningScene, layers: Layers) -> CompiledWorld:
    parts = placed_geometries(scene)
    return compile_world(scene.model, parts, watched_pairs(scene, parts, None).moving, layers)


def _among_boards(model: RobotModel, reach: float, rng: np.random.Generator) -> PlanningScene:
    """Returns a scene with boards that lie, stand and lean around the robot."""
    scene = empty_scene(model)
    for number in range(BOARDS):
        direction, turn = rng.normal(size=(2, 3))
        away = rng.uniform(NEAREST, FARTHEST) * reach
        pose = Transform(exp3(turn), away * direction / np.linalg.norm(direction))
        scene = scene.with_object(CollisionObject(f"board {number}", pose, ((Box(*BOARD), Transform.Identity()),)))
    return scene


def _motions(model: RobotModel, world: CompiledWorld, alone: CompiledWorld, rng: np.random.Generator) -> Array:
    """Returns random motions from free states, half of which touch what is in the world; shape (n, 2, joints)."""
    middle = model.default_positions()
    low, high = np.maximum(model.lower, middle - np.pi), np.minimum(model.upper, middle + np.pi)
    states = np.array([model.with_mimics(state) for state in rng.uniform(low, high, (DRAWN, len(low)))])
    free = states[_verdicts(world, np.stack([states, states], axis=1)) == FREE]
    if not len(free):
        return np.empty((0, 2, len(low)))
    starts = free[np.arange(DRAWN) % len(free)]
    ends = np.clip(starts + rng.uniform(-LONGEST, LONGEST, starts.shape), low, high)
    motions = np.stack([starts, [model.with_mimics(end) for end in ends]], axis=1)
    verdicts, verdicts_alone = _verdicts(world, motions), _verdicts(alone, motions)
    refused = (verdicts == BLOCKED) & (verdicts_alone == FREE)
    return np.concatenate([motions[verdicts == FREE][:MOTIONS], motions[refused][:MOTIONS]])


def _seconds(world: CompiledWorld, motions: Array) -> float:
    begun = time.perf_counter()
    _verdicts(world, motions)
    return time.perf_counter() - begun


def _verdicts(world: CompiledWorld, motions: Array) -> NDArray[np.int64]:
    joints = motions.shape[2]
    edges = GroupEdges(np.zeros(joints), np.eye(joints), STEP)
    return np.asarray(check_edges(edges, np.ascontiguousarray(motions), *world.arguments))
