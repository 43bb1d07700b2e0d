# SPDX-License-Identifier: BSD-3-Clause
"""Motion planning problems in YAML files (a PlanningScene and a MotionPlanRequest each), read without a ROS master."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pinocchio as pin
import yaml

from modular_framework_planning.errors import GeometryError, ModelError
from modular_framework_planning.geometry.shapes import Box, Cylinder, Shape, Sphere
from modular_framework_planning.geometry.spatial import Transform, make_transform
from modular_framework_planning.planning_interface.motion_problem_faults import request_faults, scene_faults
from modular_framework_planning.planning_interface.planning_request import JointGoal, PlanningRequest
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel

SHAPES: dict[str, type[Any]] = {"box": Box, "cylinder": Cylinder, "sphere": Sphere}


@dataclass(frozen=True, slots=True)
class MotionProblem:
    """A named planning request with its scene."""

    name: str
    request: PlanningRequest


def _load(path: Path) -> Mapping[str, Any]:
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        return yaml.load(path.read_text(), loader)  # noqa: S506 - both are safe loaders
    except (OSError, yaml.YAMLError) as error:
        raise ModelError(f"{path}: cannot be read as YAML: {error}") from error


def _pose(entry: Mapping[str, Sequence[float]] | None, source_name: str) -> Transform:
    if not entry:
        return pin.SE3.Identity()
    return make_transform(entry["position"], entry["orientation"], source_name)


def _shape(entry: Mapping[str, Any], source_name: str) -> Shape:
    kind = str(entry["type"])
    if kind not in SHAPES:
        raise GeometryError(f"{source_name}: primitive '{kind}'; allowed: {', '.join(SHAPES)}")
    return SHAPES[kind](*entry["dimensions"])


def _with_base(scene: PlanningScene, state: Mapping[str, Any] | None, source_name: str) -> PlanningScene:
    """Returns the scene with the planar or floating base at its pose in the multi_dof_joint_state of a robot state."""
    entry, base = (state or {}).get("multi_dof_joint_state") or {}, scene.model.base
    frame = str((entry.get("header") or {}).get("frame_id", ""))
    for name, item in zip(entry.get("joint_names") or (), entry.get("transforms") or (), strict=True):
        if base is not None and name == base.name:
            pose = make_transform(item["translation"], item["rotation"], f"{source_name} '{name}'")
            placed = scene.frame_transform(frame) * pose
            scene = scene.with_positions(scene.model.with_base(scene.positions, placed))
    return scene


def _with_state(scene: PlanningScene, state: Mapping[str, Any] | None, source_name: str) -> PlanningScene:
    """Returns the scene with the robot in a state; joints without a position in the state do not move."""
    joints = (state or {}).get("joint_state") or {}
    pairs = zip(joints.get("name") or (), joints.get("position") or (), strict=True)
    values = {name: float(value) for name, value in pairs if name in scene.model.index}
    return _with_base(scene.with_positions(scene.model.merge(scene.positions, values)), state, source_name)


def read_scene(model: RobotModel, path: Path) -> PlanningScene:
    """Returns the scene of a YAML file; allowed collisions of the robot come from its SRDF.

    Args:
        model: Robot model.
        path: Path of the file.

    Raises:
        ModelError: The file has an unsupported key, or names a joint that the robot does not have.
        PlanningError: A shape, a pose or a frame is invalid.
    """
    content = _load(path)
    _raise_if_any(path, scene_faults(content, model))
    scene = _with_state(empty_scene(model), content.get("robot_state"), path.name)
    for entry in content["world"].get("collision_objects") or ():
        source_name = f"{path.name} '{entry['id']}'"
        poses = entry.get("primitive_poses") or [None] * len(entry["primitives"])
        shapes = tuple(
            (_shape(item, source_name), _pose(pose, source_name))
            for item, pose in zip(entry["primitives"], poses, strict=True)
        )
        frame = scene.frame_transform(str((entry.get("header") or {}).get("frame_id", "")))
        scene = scene.with_object(CollisionObject(entry["id"], frame * _pose(entry.get("pose"), source_name), shapes))
    return scene


def read_problem(
    model: RobotModel, scene_path: Path, request_path: Path, allowed_time_s: float, group: str = ""
) -> MotionProblem:
    """Returns a problem.

    Joints without a position in the start state have their position in the scene, or 0. The start state may name
    joints that the robot does not have, such as joints of a gripper, if it has positions of all joints of the group.

    Args:
        model: Robot model.
        scene_path: YAML file of the planning scene.
        request_path: YAML file of the planning request.
        allowed_time_s: Allowed planning time [s].
        group: Planning group that replaces the group of the request; "" for none.

    Raises:
        ModelError: A file has an unsupported key, or names a group or joint that the robot does not have.
        PlanningError: A shape, a pose or a frame is invalid.
    """
    request = _load(request_path)
    _raise_if_any(request_path, request_faults(request, model, group))
    scene = _with_state(read_scene(model, scene_path), request["start_state"], request_path.name)
    goals = tuple(_joint_goal(goal["joint_constraints"]) for goal in request["goal_constraints"])
    name = f"{scene_path.parent.name}/{request_path.stem.removeprefix('request')}"
    return MotionProblem(
        name,
        PlanningRequest(
            scene,
            group or request["group_name"],
            goals,
            planner_id=request.get("planner_id", ""),
            attempts=1,
            allowed_time_s=allowed_time_s,
        ),
    )


def _joint_goal(constraints: Sequence[Mapping[str, Any]]) -> JointGoal:
    """Returns the goal for joint constraints, with their tolerances."""

    def values(key: str) -> dict[str, float]:
        return {item["joint_name"]: float(item[key]) for item in constraints if key in item}

    return JointGoal(values("position"), values("tolerance_below"), values("tolerance_above"))


def _raise_if_any(path: Path, faults: Sequence[str]) -> None:
    if faults:
        raise ModelError(f"{path}: {'; '.join(faults)}")


def read_problems(model: RobotModel, folder: Path, allowed_time_s: float) -> Iterator[MotionProblem]:
    """Yields the problems below a folder (<family>/sceneNNNN.yaml with requestNNNN.yaml), sorted by name.

    Args:
        model: Robot model.
        folder: Folder of the problem families.
        allowed_time_s: Allowed planning time of each problem [s].
    """
    for scene_path in sorted(folder.glob("*/scene*.yaml")):
        yield read_problem(
            model, scene_path, scene_path.with_name(scene_path.name.replace("scene", "request")), allowed_time_s
        )
