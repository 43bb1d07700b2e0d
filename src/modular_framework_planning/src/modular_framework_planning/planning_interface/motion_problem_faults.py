# SPDX-License-Identifier: BSD-3-Clause
"""Faults in the YAML files of a motion planning problem: names that the robot does not have, and keys without effect.

A reader that ignored a name or a key would read an easier or different problem.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel
from modular_framework_ros.allowed_names import listing, misspelling, nearest

REQUEST_KEYS = ("group_name", "start_state", "goal_constraints")
REPLACED_KEYS = (
    "workspace_parameters",  # bounds of a moving base
    "planner_id",
    "pipeline_id",
    "num_planning_attempts",
    "allowed_planning_time",
    "max_velocity_scaling_factor",
    "max_acceleration_scaling_factor",
)
"""Keys of a request that the settings of the plan replace."""
UNSUPPORTED_REQUEST_KEYS = (
    "path_constraints",
    "trajectory_constraints",
    "reference_trajectories",
    "cartesian_speed_limited_link",
    "cartesian_speed_end_effector_link",
    "max_cartesian_speed",
)
STATE_KEYS = ("joint_state", "multi_dof_joint_state", "is_diff")
JOINT_STATE_KEYS = ("header", "name", "position", "velocity", "effort")
MULTI_DOF_KEYS = ("header", "joint_names", "transforms", "twist", "wrench")
GOAL_KEYS = ("name", "joint_constraints")
UNSUPPORTED_GOAL_KEYS = ("position_constraints", "orientation_constraints", "visibility_constraints")
CONSTRAINT_KEYS = ("joint_name", "position", "tolerance_above", "tolerance_below", "weight")
SCENE_KEYS = (
    "world",
    "robot_state",
    "name",
    "robot_model_name",
    "is_diff",
    "fixed_frame_transforms",
    "allowed_collision_matrix",  # allowed collisions of the robot come from its SRDF
    "object_colors",
)
UNSUPPORTED_SCENE_KEYS = ("link_padding", "link_scale")
OBJECT_KEYS = ("id", "header", "pose", "type", "primitives", "primitive_poses")
UNSUPPORTED_OBJECT_KEYS = (
    *("meshes", "mesh_poses", "planes", "plane_poses"),
    *("subframe_names", "subframe_poses", "operation"),
)


def request_faults(content: Any, model: RobotModel, group: str = "") -> list[str]:
    """Returns the faults of a planning request.

    Args:
        content: Content of the file.
        model: Robot model.
        group: Planning group that replaces the group of the request; "" for none.
    """
    check = _ProblemCheck(model)
    request = check.mapping(content, "the request", (*REQUEST_KEYS, *REPLACED_KEYS), UNSUPPORTED_REQUEST_KEYS)
    name = group or str(request.get("group_name", ""))
    if name not in model.groups:
        check.faults.append(
            f"group_name: there is no planning group '{name}'; {listing(model.groups)}{nearest(name, model.groups)}"
        )
    found = model.groups.get(name)
    check.state(request.get("start_state"), "start_state", found)
    check.goals(request.get("goal_constraints"), found)
    moves_base = found is not None and bool(set(found.indices) & set(model.base_indices))
    if moves_base and not _is_empty(request.get("workspace_parameters")):
        check.faults.append(f"workspace_parameters are not supported, because group '{name}' moves the base; remove it")
    return check.faults


def scene_faults(content: Any, model: RobotModel) -> list[str]:
    """Returns the faults of a planning scene.

    Args:
        content: Content of the file.
        model: Robot model.
    """
    check = _ProblemCheck(model)
    scene = check.mapping(content, "the scene", SCENE_KEYS, UNSUPPORTED_SCENE_KEYS)
    if "world" not in scene:
        check.faults.append("the scene has no key 'world'; add {world: {collision_objects: [...]}}")
    world = check.mapping(scene.get("world", {}), "world", ("collision_objects",), ("octomap",))
    for index, item in enumerate(check.entries(world.get("collision_objects"), "world/collision_objects")):
        field_name = f"collision_objects[{index}]"
        entry = check.mapping(item, field_name, OBJECT_KEYS, UNSUPPORTED_OBJECT_KEYS)
        check.faults.extend(f"{field_name} has no {key}; add it" for key in ("id", "primitives") if key not in entry)
    if scene.get("robot_state"):
        check.state(scene["robot_state"], "robot_state", None)
    return check.faults


class _ProblemCheck:
    """Collects the faults of a file.

    Attributes:
        faults: Faults found so far.
    """

    def __init__(self, model: RobotModel) -> None:
        self.faults: list[str] = []
        self._model = model

    def mapping(
        self, entry: Any, field_name: str, allowed: Sequence[str], unsupported: Sequence[str] = ()
    ) -> Mapping[str, Any]:
        """Checks the keys of a mapping, and returns the mapping; empty after a fault.

        Args:
            entry: Value of the field.
            field_name: Name of the field, for faults.
            allowed: Allowed keys.
            unsupported: Known keys whose values must be empty.
        """
        if not isinstance(entry, Mapping):
            self.faults.append(f"{field_name} is {entry!r:.60}; give a mapping with the keys {', '.join(allowed)}")
            return {}
        for key, value in entry.items():
            if key in unsupported and not _is_empty(value):
                self.faults.append(f"{field_name}: {key} is not supported, and would be left out; remove it")
            elif key not in allowed and key not in unsupported:
                names = (*allowed, *unsupported)
                text = f"{field_name}: the key '{key}' is unknown; {listing(allowed)}{nearest(str(key), names)}"
                self.faults.append(text)
        return entry

    def entries(self, value: Any, field_name: str) -> Sequence[Any]:
        """Returns a list, empty for None or after a fault."""
        if value is not None and not isinstance(value, list):
            self.faults.append(f"{field_name} is {value!r:.60}; give a list")
            return ()
        return value or ()

    def state(self, entry: Any, field_name: str, group: JointGroup | None) -> None:
        """Checks a robot state.

        Args:
            entry: Value of the field.
            field_name: Name of the field, for faults.
            group: Group of the request; None for no group.
        """
        state = self.mapping(entry, field_name, STATE_KEYS, ("attached_collision_objects",))
        field_name = f"{field_name}/joint_state"
        joints = self.mapping(state.get("joint_state") or {}, field_name, JOINT_STATE_KEYS)
        names = [str(each) for each in self.entries(joints.get("name"), f"{field_name}/name")]
        positions = self.entries(joints.get("position"), f"{field_name}/position")
        if len(names) != len(positions):
            text = f"{field_name}: {len(names)} names and {len(positions)} positions; give a position per name"
            self.faults.append(text)
        for name, position in zip(names, positions, strict=False):
            self._number(position, f"{field_name}: the position of '{name}'")
        self._names(names, field_name, group)
        self._moving_bases(state.get("multi_dof_joint_state") or {})

    def _names(self, names: Collection[str], field_name: str, group: JointGroup | None) -> None:
        """Checks the joint names of a state.

        Public problems name joints of grippers that a model does not have. Such names are accepted if all joints of
        the group have positions, and if they resemble no joint without a position.
        """
        model = self._model
        free = [name for name in model.joint_names if name not in names]
        needed = group.joints if group is not None else ()
        base = {model.joint_names[index] for index in model.base_indices}
        missing = [name for name in needed if name in free and name not in model.follower_joints | base]
        unknown = [name for name in names if name not in model.index and model.document.joint_kinds.get(name) is None]
        wrong = [name for name in unknown if missing or any(misspelling(name, other) for other in free)]
        for name in wrong:
            known = f"{listing(model.joint_names)}{nearest(name, missing or free)}"
            self.faults.append(f"{field_name}: joint '{name}' is unknown; {known}")

    def _moving_bases(self, entry: Any) -> None:
        model = self._model
        state = self.mapping(entry, "multi_dof_joint_state", MULTI_DOF_KEYS)
        known = [joint.name for joint in model.semantics.virtual_joints]
        for name in self.entries(state.get("joint_names"), "multi_dof_joint_state/joint_names"):
            if name not in known and model.document.joint_kinds.get(name) is None:
                hint = f"{listing(known)}{nearest(str(name), known)}"
                self.faults.append(f"multi_dof_joint_state: joint '{name}' is unknown; {hint}")

    def goals(self, value: Any, group: JointGroup | None) -> None:
        """Checks the goals.

        Args:
            value: Value of goal_constraints.
            group: Group of the request; None if it is unknown, so that no joint is checked.
        """
        goals = self.entries(value, "goal_constraints")
        if not goals:
            self.faults.append("goal_constraints is empty; give joint constraints")
        for index, item in enumerate(goals):
            field_name = f"goal_constraints[{index}]"
            goal = self.mapping(item, field_name, GOAL_KEYS, UNSUPPORTED_GOAL_KEYS)
            constraints = self.entries(goal.get("joint_constraints"), f"{field_name}/joint_constraints")
            if not constraints:
                self.faults.append(f"{field_name} has no joint_constraints; give the target of each joint")
            for number, constraint in enumerate(constraints):
                self._constraint(constraint, f"{field_name}/joint_constraints[{number}]", group)

    def _constraint(self, item: Any, field_name: str, group: JointGroup | None) -> None:
        constraint = self.mapping(item, field_name, CONSTRAINT_KEYS)
        name = str(constraint.get("joint_name", ""))
        if group is not None and name not in group.joints and name not in self._model.document.mimics:
            hint = f"{listing(group.joints)}{nearest(name, group.joints)}"
            self.faults.append(f"{field_name}: joint '{name}' is not in group '{group.name}'; {hint}")
        self._number(constraint.get("position"), f"{field_name}: the position")
        for key in ("tolerance_above", "tolerance_below"):
            self._number(constraint.get(key, 0.0), f"{field_name}: {key}", low=0.0)

    def _number(self, value: Any, field_name: str, low: float = -math.inf) -> None:
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not is_number or value < low:
            limit = "" if low == -math.inf else f" of at least {low:g}"
            self.faults.append(f"{field_name} is {value!r:.60}; give a finite number{limit}")


def _is_empty(value: Any) -> bool:
    """Returns whether a value, including nested values, is the default of a message."""
    match value:
        case Mapping():
            return all(_is_empty(each) for each in value.values())
        case list():
            return all(_is_empty(each) for each in value)
        case _:
            return value in (None, "", 0, "\0")
