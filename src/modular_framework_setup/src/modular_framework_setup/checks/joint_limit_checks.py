# SPDX-License-Identifier: BSD-3-Clause
"""Checks joint_limits.yaml and the Cartesian limits against the robot."""

from __future__ import annotations

from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping, kind_of
from modular_framework_setup.config_files.robot_tree import LIMIT_TOLERANCE, RobotTree
from modular_framework_setup.config_files.yaml_files import has_argument, read_number, read_truth
from modular_framework_urdf.robot import Joint

# flag: required keys
LIMITS = {
    "has_position_limits": ("min_position", "max_position"),
    "has_velocity_limits": ("max_velocity",),
    "has_acceleration_limits": ("max_acceleration",),
    "has_deceleration_limits": ("max_deceleration",),
    "has_jerk_limits": ("max_jerk",),
    "has_effort_limits": ("max_effort",),
    "has_soft_limits": ("k_position", "k_velocity", "soft_lower_limit", "soft_upper_limit"),
}
OTHER_KEYS = ("angle_wraparound", "has_deceleration", "min_velocity", "min_acceleration")
KEYS = (*LIMITS, *(key for keys in LIMITS.values() for key in keys), *OTHER_KEYS)
POSITIVE_KEYS = ("max_velocity", "max_acceleration", "max_jerk", "max_effort")
TOP_KEYS = (
    "joint_limits", "cartesian_limits", "default_velocity_scaling_factor", "default_acceleration_scaling_factor",
)  # fmt: skip
CARTESIAN_KEYS = ("max_trans_vel", "max_trans_acc", "max_trans_dec", "max_rot_vel", "max_rot_acc", "max_rot_dec")
VELOCITY_TOLERANCE = 1.0e-3  # relative; covers rounded values of the URDF's velocity


def check_joint_limits(top: Mapping, tree: RobotTree, faults: FaultList) -> None:
    """Checks the content of joint_limits.yaml.

    Args:
        top: Content of the file.
        tree: Kinematic tree of the robot.
        faults: Receives the faults.
    """
    for key, node in top.entries.items():
        if key not in TOP_KEYS:
            faults.add_unknown(top.keys[key], "key", key, TOP_KEYS)
        elif key.startswith("default_"):
            value = read_number(node, key, faults)
            if value is not None and not 0.0 < value <= 1.0:
                faults.add(node.location, f"{key} is {value:g}; it must be above 0 and at most 1")
    limits = top.entries.get("joint_limits")
    if not isinstance(limits, Mapping):
        return
    movable = [joint.name for joint in tree.robot.joints if joint.kind != "fixed"]
    for name, node in limits.entries.items():
        where = limits.keys[name]
        if has_argument(name):
            continue
        if name not in tree.joints:
            faults.add_unknown(where, "joint_limits: joint", name, movable)
        elif not isinstance(node, Mapping):
            faults.add(where, f"joint_limits: '{name}' is {kind_of(node)}; expected limits such as max_velocity: 1.0")
        else:
            _JointChecker(tree.joints[name], node, faults).check()


class _JointChecker:
    """Checks the entry of one joint."""

    def __init__(self, joint: Joint, entry: Mapping, faults: FaultList) -> None:
        self._joint, self._entry, self._faults = joint, entry, faults
        self._what = f"joint_limits: '{joint.name}'"

    def check(self) -> None:
        for key in self._entry:
            if key not in KEYS:
                self._faults.add_unknown(self._entry.keys[key], f"{self._what}: key", key, KEYS)
        for flag, keys in LIMITS.items():
            if self._is_set(flag, keys):
                for key in keys:
                    self._check_value(flag, key)

    def _is_set(self, flag: str, keys: tuple[str, ...]) -> bool:
        if flag not in self._entry.entries:
            return any(key in self._entry.entries for key in keys)
        return read_truth(self._entry.entries[flag], f"{self._what}: {flag}", self._faults) is True

    def _check_value(self, flag: str, key: str) -> None:
        node = self._entry.entries.get(key)
        if node is None:
            if flag in self._entry.entries:
                where = self._entry.keys[flag]
                self._faults.add(where, f"{self._what}: {flag} is true, but {key} is missing; add it, or write false")
            return
        value = read_number(node, f"{self._what}: {key}", self._faults)
        if value is None:
            return
        where = self._entry.keys[key]
        if key in POSITIVE_KEYS and value <= 0.0:
            self._faults.add(where, f"{self._what}: {key} is {value:g}; it must be above 0")
        elif key == "max_deceleration" and value >= 0.0:
            self._faults.add(where, f"{self._what}: {key} is {value:g}; it must be below 0")
        else:
            self._check_against_urdf(key, value)

    def _check_against_urdf(self, key: str, value: float) -> None:
        limit, where = self._joint.limit, self._entry.keys[key]
        if limit is None:
            return
        wider = f"{self._what}: {key} {value:g} is wider than the URDF's"
        rule = "MoveIt uses this value, and the robot may not follow"
        if key == "max_velocity" and limit.velocity and value > limit.velocity * (1.0 + VELOCITY_TOLERANCE):
            self._faults.add(where, f"{wider} {limit.velocity:g}; {rule}; allowed: at most {limit.velocity:g}")
        if self._joint.kind not in ("revolute", "prismatic"):
            return
        if key == "min_position" and value < limit.lower - LIMIT_TOLERANCE:
            self._faults.add(where, f"{wider} {limit.lower:g}; {rule}; allowed: at least {limit.lower:g}")
        if key == "max_position" and value > limit.upper + LIMIT_TOLERANCE:
            self._faults.add(where, f"{wider} {limit.upper:g}; {rule}; allowed: at most {limit.upper:g}")
        is_outside = (key == "min_position" and value > limit.upper) or (key == "max_position" and value < limit.lower)
        if is_outside:
            self._faults.add(
                where,
                f"{self._what}: {key} {value:g} leaves no range; allowed by the URDF: {limit.lower:g} to "
                f"{limit.upper:g}; correct it",
            )


def check_cartesian_limits(top: Mapping, faults: FaultList) -> None:
    """Checks `cartesian_limits` of cartesian_limits.yaml or pilz_cartesian_limits.yaml."""
    limits = top.entries.get("cartesian_limits")
    if not isinstance(limits, Mapping):
        keys = ", ".join(top) or "nothing"
        faults.add(top.location, f"there is no mapping 'cartesian_limits'; found: {keys}; add it")
        return
    for key, node in limits.entries.items():
        if key not in CARTESIAN_KEYS:
            faults.add_unknown(limits.keys[key], "cartesian_limits: key", key, CARTESIAN_KEYS)
            continue
        value = read_number(node, f"cartesian_limits: {key}", faults)
        if value is not None and (value >= 0.0 if key.endswith("_dec") else value <= 0.0):
            side = "below" if key.endswith("_dec") else "above"
            faults.add(node.location, f"cartesian_limits: {key} is {value:g}; it must be {side} 0")
