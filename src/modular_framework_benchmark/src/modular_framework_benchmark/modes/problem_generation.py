# SPDX-License-Identifier: BSD-3-Clause
"""Generates motion planning problems for any robot: random boxes within reach, random collision-free start and goal.

Each problem is a PlanningScene and a MotionPlanRequest in YAML, readable by the key `problems` of an experiment.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.geometry.spatial import Array, Transform, make_transform
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel

REACH_SAMPLES = 1000
STRAIGHT_STEP = 0.02  # [rad or m]
ATTEMPTS = 1000  # attempts to sample a state before new boxes are sampled
SCENE_ATTEMPTS = 20
BOX_EDGE_IN_REACH = (0.05, 0.3)  # smallest and largest edge as a fraction of the robot's reach
BOX_DISTANCE_IN_REACH = (0.4, 1.0)  # distance of a box's centre from the base as a fraction of the reach


def make_problems(robot: Robot, group_name: str, count: int, boxes: int, seed: int) -> list[tuple[Any, Any]]:
    """Returns problems with collision-free start and goal whose straight joint-space motion collides.

    Args:
        robot: Robot.
        group_name: Planning group.
        count: Number of problems.
        boxes: Number of boxes per problem.
        seed: Seed that reproduces the problems.

    Returns:
        A scene (moveit_msgs/PlanningScene) and a request (moveit_msgs/MotionPlanRequest) per problem, as YAML values.

    Raises:
        ModeError: No collision-free state was found.
    """
    generator, model = np.random.default_rng(seed), robot.model
    group = model.group(group_name)
    base, reach = _reach(model, group, generator)
    problems = []
    for _ in range(count):
        scene, start, goal = _free_problem(
            model, group, lambda: _random_boxes(boxes, base, reach, generator), generator
        )
        problems.append((_scene_values(scene, model), _request_values(model, group, start, goal)))
    return problems


def write_problems(problems: list[tuple[Any, Any]], folder: Path) -> None:
    """Writes `sceneNNNN.yaml` and `requestNNNN.yaml` of each problem, numbered from 1.

    Raises:
        ModeError: The folder contains problems already.
    """
    if any(folder.glob("scene*.yaml")):
        raise ModeError(f"{folder}: contains problems already; remove it, or choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    for number, (scene, request) in enumerate(problems, 1):
        for name, content in (("scene", scene), ("request", request)):
            path = folder / f"{name}{number:04d}.yaml"
            path.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def _reach(model: RobotModel, group: JointGroup, generator: np.random.Generator) -> tuple[Array, float]:
    """Returns the position of the group's base, shape (3,), and the reach of its tip from there [m]."""
    positions = model.default_positions()
    tip = group.tip_link or group.links[-1]
    base = model.link_transforms(positions)[group.base_link or model.planning_frame].translation
    reach = 0.0
    for _ in range(REACH_SAMPLES):
        positions[group.indices] = _random_values(model, group, generator)
        reach = max(reach, float(np.linalg.norm(model.link_transforms(positions)[tip].translation - base)))
    return base, reach


def _random_values(model: RobotModel, group: JointGroup, generator: np.random.Generator) -> Array:
    lower, upper = np.maximum(model.lower[group.indices], -np.pi), np.minimum(model.upper[group.indices], np.pi)
    return generator.uniform(lower, upper)


def _random_boxes(count: int, base: Array, reach: float, generator: np.random.Generator) -> list[tuple[Transform, Box]]:
    result = []
    for _ in range(count):
        direction = generator.normal(size=3)
        distance = generator.uniform(*BOX_DISTANCE_IN_REACH) * reach
        half_yaw = generator.uniform(-np.pi, np.pi) / 2.0
        pose = make_transform(
            (base + distance * direction / np.linalg.norm(direction)).round(4).tolist(),
            [0.0, 0.0, float(np.sin(half_yaw)), float(np.cos(half_yaw))],
            "box",
        )
        result.append((pose, Box(*(generator.uniform(*BOX_EDGE_IN_REACH, 3) * reach).round(4).tolist())))
    return result


def _free_problem(
    model: RobotModel,
    group: JointGroup,
    draw_boxes: Callable[[], list[tuple[Transform, Box]]],
    generator: np.random.Generator,
) -> tuple[PlanningScene, Array, Array]:
    """Returns a scene with collision-free start and goal whose straight joint-space motion collides.

    Start and goal have the shape (joints of the robot,).
    """
    for _ in range(SCENE_ATTEMPTS):
        scene = empty_scene(model)
        for number, (pose, box) in enumerate(draw_boxes(), 1):
            scene = scene.with_object(CollisionObject(f"box_{number}", pose, ((box, pin.SE3.Identity()),)))
        checker = DEFAULT_CHECKER(scene, group.indices)
        free: list[Array] = []
        for _ in range(ATTEMPTS):
            positions = model.default_positions()
            positions[group.indices] = _random_values(model, group, generator).round(6)
            positions = model.with_mimics(positions)
            if checker.contacts(positions):
                continue
            free = [*free[-1:], positions]
            if len(free) == 2 and not checker.path_is_free(np.array(free), STRAIGHT_STEP):
                return scene, free[0], free[1]
    raise ModeError(
        f"group '{group.name}': no two free states with an obstacle between them in {SCENE_ATTEMPTS} scenes with "
        f"{ATTEMPTS} random states each; change the number of boxes"
    )


def _scene_values(scene: PlanningScene, model: RobotModel) -> dict[str, Any]:
    objects = []
    for body in scene.objects.values():
        (shape, _), pose = body.shapes[0], body.pose
        assert isinstance(shape, Box)
        objects.append(
            {
                "header": {"frame_id": model.planning_frame},
                "id": body.name,
                "primitives": [{"type": "box", "dimensions": [shape.x, shape.y, shape.z]}],
                "primitive_poses": [
                    {
                        "position": pose.translation.tolist(),
                        "orientation": [float(value) for value in _quaternion(pose)],
                    }
                ],
            }
        )
    return {"world": {"collision_objects": objects}}


def _quaternion(pose: Transform) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(pose.rotation).as_quat().round(9)


def _request_values(model: RobotModel, group: JointGroup, start: Array, goal: Array) -> dict[str, Any]:
    constraints = [
        {"joint_name": name, "position": float(goal[model.index[name]])}
        for name in group.joints
        if name not in model.follower_joints
    ]
    return {
        "group_name": group.name,
        "start_state": {"joint_state": {"name": list(model.joint_names), "position": start.round(6).tolist()}},
        "goal_constraints": [{"joint_constraints": constraints}],
    }
