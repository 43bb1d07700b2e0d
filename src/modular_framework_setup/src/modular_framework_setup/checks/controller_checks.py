# SPDX-License-Identifier: BSD-3-Clause
"""Checks controllers against the robot and the groups, and MoveIt's controllers against the hardware controllers."""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping
from modular_framework_core.files.located_yaml import Sequence as YamlSequence
from modular_framework_planning.trajectory_execution.controllers import ACTION_KINDS, FAKE_KINDS, GRIPPER, TRAJECTORY
from modular_framework_ros.allowed_names import closest, listing, nearest
from modular_framework_setup.checks.controller_records import (
    HardwareController,
    Located,
    MoveItController,
    hardware_controllers,
    moveit_controllers,
    names_moveit_controllers,
)
from modular_framework_setup.config_files.robot_tree import RobotTree, Semantics
from modular_framework_setup.config_files.yaml_files import has_argument, plain_text

KINDS = (*ACTION_KINDS, "ParallelGripperCommand")
ACTIONS = ("follow_joint_trajectory", "gripper_cmd", "gripper_action", "joint_trajectory_action")
# suffix of a hardware controller's type: matching types and action in MoveIt
MATCHES = {
    "JointTrajectoryController": ((TRAJECTORY,), "follow_joint_trajectory"),
    "GripperActionController": ((GRIPPER, "ParallelGripperCommand"), "gripper_cmd"),
}


class ControllerChecker:
    """Checks the controllers of all files.

    Args:
        tree: Kinematic tree of the robot.
        semantics: Groups and states of the SRDF; None if unreadable.
        faults: Receives the faults.
    """

    def __init__(self, tree: RobotTree, semantics: Semantics | None, faults: FaultList) -> None:
        self._tree, self._semantics, self._faults = tree, semantics, faults
        self._moveit_files: list[list[MoveItController]] = []
        self._hardware: list[HardwareController] = []

    def add_file(self, file_name: str, top: Mapping) -> None:
        """Checks one file on its own."""
        is_fake = file_name.startswith("fake")
        if names_moveit_controllers(top):
            controllers = moveit_controllers(top, self._faults)
            self._check_listed(controllers, FAKE_KINDS if is_fake else KINDS, is_fake)
            if is_fake:
                self._check_initial(top)
            else:
                self._moveit_files.append(controllers)
        else:
            hardware = hardware_controllers(top)
            for item in hardware:
                self._check_joints(f"controller '{item.name}'", item.joints)
            self._hardware += hardware

    def check_together(self) -> None:
        """Checks that all files agree."""
        moving = [item for item in self._hardware if item.moves]
        for controllers in self._moveit_files:
            for controller in controllers:
                if moving and not has_argument(controller.name):
                    self._check_hardware(controller, moving)
        self._check_groups()

    def _check_joints(self, owner: str, joints: Sequence[Located]) -> None:
        seen_joints = set()
        for name, where in joints:
            if has_argument(name):
                continue
            if name not in self._tree.joints:
                movable = [joint.name for joint in self._tree.robot.movable_joints()]
                self._faults.add_unknown(where, f"{owner}: joint", name, movable)
            elif self._tree.joints[name].kind == "fixed":
                self._faults.add(where, f"{owner}: joint '{name}' is fixed and cannot move; remove it")
            if name in seen_joints:
                self._faults.add(where, f"{owner}: joint '{name}' is listed twice; remove one entry")
            seen_joints.add(name)

    def _check_listed(self, controllers: Sequence[MoveItController], kinds: Sequence[str], is_fake: bool) -> None:
        claims: dict[str, MoveItController] = {}
        for item in controllers:
            owner = f"controller '{item.name}'"
            self._check_joints(owner, item.joints)
            kind, where = item.kind
            if not has_argument(kind) and kind not in kinds and not (is_fake and not kind):
                self._faults.add_unknown(where, f"{owner}: type", kind, kinds)
            self._check_action(item)
            for joint, location in item.joints if item.is_default else ():
                other = claims.setdefault(joint, item)
                if other is not item and not has_argument(joint):
                    self._faults.add(
                        location,
                        f"{owner}: joint '{joint}' also belongs to default controller '{other.name}' "
                        f"(line {other.location.line}); a joint may have only one default controller; write "
                        "default: false for one of them",
                    )

    def _check_action(self, item: MoveItController) -> None:
        """Reports an action name that is similar to a usual name; other names may be intended."""
        if item.action_ns is None:
            return
        action, where = item.action_ns
        if action not in ACTIONS and not has_argument(action) and closest(action, ACTIONS):
            self._faults.add_unknown(where, f"controller '{item.name}': action_ns", action, ACTIONS)

    def _check_initial(self, top: Mapping) -> None:
        """Checks the initial states of fake controllers."""
        initial = top.entries.get("initial")
        if self._semantics is None or not isinstance(initial, YamlSequence):
            return
        for entry in initial.items:
            if not isinstance(entry, Mapping):
                continue
            group, pose = plain_text(entry.entries.get("group")), plain_text(entry.entries.get("pose"))
            if has_argument(group) or has_argument(pose):
                continue
            if group not in self._semantics.groups:
                self._faults.add_unknown(entry.location, "initial: group", group, self._semantics.groups)
            elif pose not in (states := self._semantics.states.get(group, frozenset())):
                self._faults.add_unknown(entry.location, f"initial: state of group '{group}'", pose, sorted(states))

    def _check_hardware(self, controller: MoveItController, moving: Sequence[HardwareController]) -> None:
        if not controller.name:
            return
        names = [item.name for item in moving]
        hardware = next((item for item in moving if item.name == controller.name.rsplit("/", 1)[-1]), None)
        if hardware is None:
            files = ", ".join(dict.fromkeys(item.location.file for item in moving))
            self._faults.add(
                controller.location,
                f"controller '{controller.name}' is not a hardware controller ({files}); {listing(names)}"
                f"{nearest(controller.name, names)}; use the same names on both sides",
            )
            return
        where = f"{hardware.location.file}:{hardware.location.line}"
        kinds, action = next(match for suffix, match in MATCHES.items() if hardware.kind.endswith(suffix))
        if controller.kind[0] in KINDS and controller.kind[0] not in kinds:
            self._faults.add(
                controller.kind[1],
                f"controller '{controller.name}' has type {controller.kind[0]}, but the hardware's ({where}) is a "
                f"{hardware.kind}, which requires {' or '.join(kinds)}; correct one of them",
            )
        elif controller.action_ns and controller.action_ns[0] in ACTIONS and controller.action_ns[0] != action:
            self._faults.add(
                controller.action_ns[1],
                f"controller '{controller.name}' has action_ns {controller.action_ns[0]}, but the hardware's "
                f"({where}), a {hardware.kind}, has the action {action}; correct it",
            )
        if hardware.joints and {name for name, _ in controller.joints} != {name for name, _ in hardware.joints}:
            self._check_same_joints(controller, hardware)

    def _check_same_joints(self, controller: MoveItController, hardware: HardwareController) -> None:
        moveit_joints, hardware_joints = ({name for name, _ in item.joints} for item in (controller, hardware))
        if any(map(has_argument, moveit_joints)) or (
            controller.kind[0] != TRAJECTORY and hardware_joints <= moveit_joints
        ):
            return  # a gripper is commanded by one of its joints
        only = (
            [f"only here: {', '.join(sorted(moveit_joints - hardware_joints))}"]
            if moveit_joints - hardware_joints
            else []
        )
        only += (
            [f"only there: {', '.join(sorted(hardware_joints - moveit_joints))}"]
            if hardware_joints - moveit_joints
            else []
        )
        self._faults.add(
            controller.location,
            f"controller '{controller.name}' and the hardware controller of this name "
            f"({hardware.location.file}:{hardware.location.line}) move different joints; {'; '.join(only)}; "
            "list the same joints",
        )

    def _check_groups(self) -> None:
        """Reports groups of which controllers move only a part; a group without controllers may be intended."""
        if self._semantics is None:
            return
        for group in self._semantics.groups.values():
            moved = [self._moved_joints(controllers) & set(group.active) for controllers in self._moveit_files]
            best = max(moved, key=len, default=set())
            if not best or len(best) == len(group.active):
                continue
            missing = [joint for joint in group.active if joint not in best]
            first = self._moveit_files[moved.index(best)][0].location
            self._faults.add(
                first,
                f"no controller in this file moves {', '.join(missing)} of group '{group.name}', but controllers move "
                f"its other joints; add {'it' if len(missing) == 1 else 'them'} to a controller",
            )

    @staticmethod
    def _moved_joints(controllers: Sequence[MoveItController]) -> set[str]:
        return {joint for item in controllers for joint, _ in item.joints}
