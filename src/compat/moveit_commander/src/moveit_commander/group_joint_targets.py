# SPDX-License-Identifier: BSD-3-Clause
"""Joint targets of a group: joint values, named states, random states, and inverse kinematics of a pose."""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from enum import Enum, auto
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import MoveItErrorCodes, RobotState
from moveit_msgs.srv import GetPositionIK, GetPositionIKRequest
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from modular_framework_urdf.mimics import with_leaders
from moveit_commander import conversions
from moveit_commander.chain_jacobian import nearest_values
from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_connection import code_text, forward_kinematics, held_frames
from moveit_commander.group_settings import GroupSettings
from moveit_commander.robot_model import group_values


class Target(Enum):
    """Kind of the active target, which is the target set last."""

    JOINT = auto()
    POSE = auto()
    POSITION = auto()
    ORIENTATION = auto()


class GroupJointTargets(GroupSettings):
    """Joint targets of a group; a rejected target leaves the previous target active."""

    def __init__(self, name: str, robot_description: str, ns: str, wait_for_servers: float) -> None:
        super().__init__(name, robot_description, ns, wait_for_servers)
        defaults = self._model.defaults()
        self._joint_target = {
            joint.name: defaults[joint.name] for joint in self._group.variables if joint.name in defaults
        }
        self._active_target = Target.JOINT
        self._remembered: dict[str, list[float]] = {}
        self._random = random.Random()

    def get_joint_value_target(self) -> list[float]:
        """Returns the joint target [rad or m], in the order of the group's variables."""
        return [self._joint_target[joint.name] for joint in self._group.variables if joint.name in self._joint_target]

    def set_joint_value_target(self, arg1: Any, arg2: Any = None, arg3: Any = None) -> None:
        """Sets a joint target.

        Args:
            arg1: A list with every variable of the group; a dict or JointState with some variables; the name of a
                joint or variable; or a Pose or PoseStamped, which compute_ik immediately converts to joint values.
            arg2: For a joint name, its value or a list of values per variable. For a pose, the link (str), or whether
                an approximate solution suffices (bool).
            arg3: For a pose, the link or the approximation flag, whichever `arg2` is not.

        Raises:
            MoveItCommanderException: A joint or link is unknown, a value is out of bounds, or the pose has no solution.
        """
        if isinstance(arg1, Pose | PoseStamped):
            self._set_from_pose(arg1, *link_and_approximate(arg2, arg3))
            return
        if arg3 is not None or (arg2 is not None and not isinstance(arg1, str)):
            raise MoveItCommanderException(
                "Too many arguments specified: list, dict and JointState stand alone, a joint's name takes one value"
            )
        if isinstance(arg1, JointState):
            if len(arg1.name) != len(arg1.position):
                raise MoveItCommanderException(
                    f"JointState has {len(arg1.name)} names and {len(arg1.position)} positions; each joint needs both"
                )
            self._set_values(dict(zip(arg1.name, arg1.position, strict=True)))
        elif isinstance(arg1, str):
            self._set_values(self._values_of_joint(arg1, arg2))
        elif isinstance(arg1, Mapping):
            self._set_values(arg1)
        elif isinstance(arg1, Iterable):
            self._set_values(group_values(self._group, list(arg1)))
        else:
            raise MoveItCommanderException(
                f"Unsupported argument of type {type(arg1)}; allowed: list, dict, "
                "JointState, Pose, PoseStamped, or a joint's name and value"
            )

    def set_random_target(self) -> None:
        """Sets a joint target sampled uniformly within the bounds."""
        self._set_values(self._model.random_values(self._group, self._random))

    def get_random_joint_values(self) -> list[float]:
        """Returns joint values sampled uniformly within the bounds [rad or m]; passive joints keep their target."""
        values = self._joint_target | self._model.random_values(self._group, self._random)
        return [values[joint.name] for joint in self._group.variables if joint.name in values]

    def get_random_pose(self, end_effector_link: str = "") -> PoseStamped:
        """Returns the pose of a link (default: the end effector link) at joint values sampled within the bounds."""
        self._link(end_effector_link, "get the pose of")
        drawn = self._state.positions(self._group_names()) | self._model.random_values(self._group, self._random)
        return self._pose_of(end_effector_link, self._state.message_of(drawn))

    def get_named_targets(self) -> list[str]:
        """Returns the names of the joint targets in the SRDF and of remembered joint values."""
        return sorted({*self._group.states, *self._remembered})

    def set_named_target(self, name: str) -> None:
        """Sets a joint target by a name of the SRDF or of remembered joint values."""
        self._set_values(self.get_named_target_values(name))

    def get_named_target_values(self, target: str) -> dict[str, float]:
        """Returns the joint values of a named target [rad or m], keyed by joint."""
        if target in self._remembered:
            return group_values(self._group, self._remembered[target])
        if target not in self._group.states:
            raise MoveItCommanderException(
                f"Unable to set target {target}: group '{self._group.name}' has no such "
                f"named target; it has: {', '.join(self.get_named_targets()) or 'none'}"
            )
        return dict(self._group.states[target])

    def remember_joint_values(self, name: str, values: Iterable[float] | None = None) -> None:
        """Stores joint values under a name; by default the current values."""
        kept = self.get_current_joint_values() if values is None else [float(value) for value in values]
        group_values(self._group, kept)
        self._remembered[name] = kept

    def get_remembered_joint_values(self) -> dict[str, list[float]]:
        """Returns the remembered joint values [rad or m], keyed by name."""
        return {name: list(values) for name, values in self._remembered.items()}

    def forget_joint_values(self, name: str) -> None:
        """Removes remembered joint values; an unknown name is ignored."""
        self._remembered.pop(name, None)

    def _set_values(self, values: Mapping[str, Any]) -> None:
        joints = {joint.name: joint for joint in self._group.variables}
        for name, value in values.items():
            if name not in joints:
                raise MoveItCommanderException(
                    f"Error setting joint target: group '{self._group.name}' has no joint "
                    f"'{name}'; it has: {', '.join(joints)}"
                )
            if not joints[name].admits(float(value), self._joint_tolerance):
                raise MoveItCommanderException(
                    f"Error setting joint target. Is the target within bounds? Joint '{name}': got {value}; allowed: "
                    f"[{joints[name].lower:.6g}, {joints[name].upper:.6g}]"
                )
        mimics = {name: mimic for name, mimic in self._model.mimics.items() if mimic.leader in joints}
        target = self._joint_target | with_leaders({name: float(value) for name, value in values.items()}, mimics)
        self._joint_target = {
            **target,
            **{name: value for name, value in self._model.complete(target).items() if name in joints},
        }
        self._active_target = Target.JOINT

    def _values_of_joint(self, name: str, value: Any) -> dict[str, float]:
        """Returns the values of a joint's variables, keyed by variable."""
        if value is None:
            raise MoveItCommanderException(f"Joint value expected when joint name specified ('{name}')")
        values = list(value) if isinstance(value, Iterable) else [value]
        parts = next((joint.parts for joint in self._group.joints if joint.name == name), ())
        names = [part.name for part in parts] or [name]
        if len(values) != len(names):
            listed = f" ({', '.join(names)})" if parts else ""
            raise MoveItCommanderException(
                f"joint '{name}' has {len(names)} variable{'s' if parts else ''}{listed}; got {len(values)} values"
            )
        return {part: float(number) for part, number in zip(names, values, strict=True)}

    def _set_from_pose(self, pose: Pose | PoseStamped, link: str, approximate: bool) -> None:
        stamped = pose if isinstance(pose, PoseStamped) else PoseStamped(pose=pose)
        request = GetPositionIKRequest()
        ik_request = request.ik_request
        ik_request.group_name, ik_request.ik_link_name = self._group.name, self._link(link, "set the pose for")
        ik_request.pose_stamped.pose = stamped.pose
        ik_request.pose_stamped.header.frame_id = stamped.header.frame_id or self.get_pose_reference_frame()
        ik_request.robot_state = self._state.message_of(self._seed())
        ik_request.robot_state.is_diff = True
        response = self._servers.call("compute_ik", GetPositionIK, request)
        if response.error_code.val == MoveItErrorCodes.NO_IK_SOLUTION and approximate:
            self._set_values(self._nearest_values(ik_request.ik_link_name, ik_request.pose_stamped))
            return
        if response.error_code.val != MoveItErrorCodes.SUCCESS:
            raise MoveItCommanderException(
                f"Error setting joint target: service {self._servers.resolve('compute_ik')}"
                f" answers {code_text(response.error_code)}. Is the pose within reach, and "
                "the IK solver functional?"
            )
        found, wanted = self._state.values_of(response.solution), set(self._group_names())
        self._set_values({name: value for name, value in found.items() if name in wanted})

    def _seed(self) -> dict[str, float]:
        """Returns the joint target without passive joints, which do not move."""
        return {name: value for name, value in self._joint_target.items() if name not in self._model.passive}

    def _nearest_values(self, link: str, pose: PoseStamped) -> dict[str, float]:
        """Returns joint values near the current target that minimise the pose error of a link."""
        start = {**self._joint_target, **self._state.positions(self._group_names()), **self._seed()}
        passive = self._model.passive
        moved = [joint for joint in self._group.active_joints if joint.is_movable and joint.name not in passive]
        base = next(joint.parent for joint in self._group.joints if joint.is_movable)
        base_pose = forward_kinematics(self._servers, pose.header.frame_id, base, self._state.message_of(start)).pose
        base_rotation, base_position = _rotation_and_position(base_pose)
        rotation, position = _rotation_and_position(pose.pose)
        if link not in self._model.links:
            holder = held_frames(self._servers)[link]
            held_pose = forward_kinematics(self._servers, holder, link, RobotState(is_diff=True)).pose
            held_rotation, held_position = _rotation_and_position(held_pose)
            link, rotation = holder, rotation * held_rotation.inv()
            position = position - rotation.apply(held_position)
        frame_to_base = base_rotation.inv()
        return nearest_values(
            self._model.chain(base, link),
            moved,
            start,
            self._model.complete,
            rotation=frame_to_base * rotation,
            position=frame_to_base.apply(position - base_position),
        )


def link_and_approximate(*arguments: Any) -> tuple[str, bool]:
    """Returns the link and the approximation flag from the optional arguments of a pose target."""
    link, approximate = "", False
    for argument in arguments:
        match argument:
            case None:
                continue
            case str():
                link = argument
            case bool():
                approximate = argument
            case _:
                raise MoveItCommanderException(
                    f"Unexpected type {type(argument)}: a link's name (str) or whether the "
                    "pose is approximate (bool) may follow a pose"
                )
    return link, approximate


def _rotation_and_position(pose: Pose) -> tuple[Rotation, Any]:
    """Returns the rotation and the position [m] of a pose."""
    values = conversions.pose_to_list(pose)
    return Rotation.from_quat(values[3:]), np.array(values[:3])
