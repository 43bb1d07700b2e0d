# SPDX-License-Identifier: BSD-3-Clause
"""Renders a config package as one HTML page with groups, joints, limits, states and the collision matrix."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from modular_framework_core.files.located_yaml import Mapping as YamlMapping
from modular_framework_core.files.located_yaml import Scalar
from modular_framework_setup.checks.package_check import CheckedPackage
from modular_framework_setup.config_files.config_package import find_package
from modular_framework_setup.config_files.robot_tree import PlanningGroup, RobotTree, Semantics
from modular_framework_urdf.robot import Joint
from modular_framework_urdf.srdf_reader import SemanticDescription

REASONS = ("Adjacent", "Never", "Always", "Default")
OTHER, CHECKED = "Other", "checked"


@dataclass(frozen=True, slots=True)
class Mark:
    """Mark of a named state on the bar of a joint.

    Attributes:
        state: Group and name of the state, separated by a space.
        position: Joint position [rad or m].
        percent: Position on the scale [%].
    """

    state: str
    position: float
    percent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JointRow:
    """A movable joint, with its range on a scale common to all joints of its kind.

    Attributes:
        name: Name of the joint.
        kind: URDF type.
        unit: Unit of positions.
        lower: Lower position limit [rad or m]; None if unlimited.
        upper: Upper position limit [rad or m]; None if unlimited.
        left: Left edge of the bar on the scale [%].
        width: Width of the bar on the scale [%].
        zero: Position 0 on the scale [%].
        tight: Left edge and width of the range in joint_limits.yaml [%]; None if equal to the URDF's range.
        velocity: Velocity limit of the URDF [rad/s or m/s].
        velocity_in_file: Velocity limit of joint_limits.yaml [rad/s or m/s].
        acceleration: Acceleration limit of joint_limits.yaml [rad/s^2 or m/s^2].
        effort: Effort limit [N m or N].
        follows: Formula of a mimic joint; "" for other joints.
        groups: Planning groups with this joint.
        marks: Named states with this joint.
    """

    name: str
    kind: str
    unit: str
    lower: float | None
    upper: float | None
    left: float
    width: float
    zero: float
    tight: tuple[float, float] | None
    velocity: float | None
    velocity_in_file: float | None
    acceleration: float | None
    effort: float | None
    follows: str
    groups: tuple[str, ...]
    marks: tuple[Mark, ...]


@dataclass(frozen=True, slots=True)
class GroupRow:
    """A planning group.

    Attributes:
        name: Name of the group.
        ends: Chains and subgroups, as text.
        active: Joints that a planner moves.
        others: Other joints, sorted.
        solver: Kinematics solver in kinematics.yaml; "" if none is given.
        states: Names of the named states.
    """

    name: str
    ends: str
    active: tuple[str, ...]
    others: tuple[str, ...]
    solver: str
    states: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of the collision matrix.

    Attributes:
        kind: One of REASONS, OTHER and CHECKED; "" on the diagonal.
        text: Description with the link names.
    """

    kind: str
    text: str


def page_text(checked: CheckedPackage) -> str:
    """Returns a self-contained HTML page.

    Args:
        checked: Checked package; unreadable parts are omitted.
    """
    tree = checked.tree
    semantics, srdf = checked.semantics or Semantics(), checked.srdf or SemanticDescription("")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(find_package("modular_framework_setup")) / "templates" / "page"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    links = [link.name for link in tree.robot.links if link.collisions] if tree else []
    cells = [[_cell(first, second, srdf) for second in links] for first in links]
    kinds = [cell.kind for index, row in enumerate(cells) for cell in row[:index]]
    return environment.get_template("robot.html.jinja").render(
        package=checked.package.name,
        robot=tree.robot.name if tree else "",
        faults=checked.faults,
        groups=[_group_row(group, checked, srdf) for group in semantics.groups.values()],
        joints=_joint_rows(tree, checked, semantics, srdf) if tree else [],
        states=srdf.group_states,
        effectors=srdf.end_effectors,
        virtual_joints=srdf.virtual_joints,
        links=links,
        cells=cells,
        counts={kind: kinds.count(kind) for kind in (*REASONS, OTHER, CHECKED)},
    )


def _cell(first: str, second: str, srdf: SemanticDescription) -> Cell:
    if first == second:
        return Cell("", first)
    pair = frozenset((first, second))
    if pair in srdf.disabled_pairs and pair not in srdf.enabled_pairs:
        reason = srdf.disabled_pairs[pair]
        return Cell(reason if reason in REASONS else OTHER, f"{first} – {second}: not checked, {reason or 'no reason'}")
    if set(srdf.touching_links) & pair and pair not in srdf.enabled_pairs:
        return Cell(OTHER, f"{first} – {second}: not checked, disable_default_collisions")
    return Cell(CHECKED, f"{first} – {second}: checked")


def _value(node: Any, *keys: str) -> Any:
    """Returns a value in a YAML file, or None if missing."""
    for key in keys:
        node = node.entries.get(key) if isinstance(node, YamlMapping) else None
    return node.value if isinstance(node, Scalar) else None


def _number(node: Any, *keys: str) -> float | None:
    value = _value(node, *keys)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _group_row(group: PlanningGroup, checked: CheckedPackage, srdf: SemanticDescription) -> GroupRow:
    spec = srdf.groups.get(group.name)
    chains = [f"{base} → {tip}" for base, tip in spec.chains] if spec else []
    parts = [*chains, *(f"group {name}" for name in spec.subgroups)] if spec else []
    return GroupRow(
        group.name,
        ", ".join(parts),
        group.active,
        tuple(sorted(group.joints - set(group.active))),
        str(_value(checked.files.get("kinematics"), group.name, "kinematics_solver") or ""),
        tuple(srdf.group_states.get(group.name, {})),
    )


def _joint_rows(
    tree: RobotTree, checked: CheckedPackage, semantics: Semantics, srdf: SemanticDescription
) -> list[JointRow]:
    joints = list(tree.robot.movable_joints())
    prismatic = [joint for joint in joints if joint.kind == "prismatic"]
    prismatic_scale, revolute_scale = _scale(prismatic), _scale([joint for joint in joints if joint not in prismatic])
    limits = checked.files.get("joint_limits")
    return [
        _joint_row(
            joint, prismatic_scale if joint in prismatic else revolute_scale, limits, semantics, srdf.group_states
        )
        for joint in joints
    ]


def _scale(joints: Sequence[Joint]) -> tuple[float, float]:
    """Returns the lowest and highest position of joints; unlimited joints count as [-pi, pi] [rad]."""
    ends = [_range(joint) for joint in joints]
    return min((low for low, _ in ends), default=0.0), max((high for _, high in ends), default=1.0)


def _range(joint: Joint) -> tuple[float, float]:
    if joint.kind == "continuous" or joint.limit is None:
        return -math.pi, math.pi
    return joint.limit.lower, joint.limit.upper


def _joint_row(
    joint: Joint,
    scale: tuple[float, float],
    limits: YamlMapping | None,
    semantics: Semantics,
    states: Mapping[str, Mapping[str, Mapping[str, float]]],
) -> JointRow:
    low, high = _range(joint)
    length = max(scale[1] - scale[0], 1e-9)

    def percent(position: float) -> float:
        return round(100.0 * min(max((position - scale[0]) / length, 0.0), 1.0), 2)

    is_limited = joint.kind != "continuous" and joint.limit is not None
    entry = ("joint_limits", joint.name)
    tight_low, tight_high = _number(limits, *entry, "min_position"), _number(limits, *entry, "max_position")
    tight = (max(low, low if tight_low is None else tight_low), min(high, high if tight_high is None else tight_high))
    return JointRow(
        name=joint.name,
        kind=joint.kind,
        unit="m" if joint.kind == "prismatic" else "rad",
        lower=low if is_limited else None,
        upper=high if is_limited else None,
        left=percent(low),
        width=round(percent(high) - percent(low), 2),
        zero=percent(0.0),
        tight=(percent(tight[0]), round(percent(tight[1]) - percent(tight[0]), 2)) if tight != (low, high) else None,
        velocity=joint.limit.velocity if joint.limit else None,
        velocity_in_file=_number(limits, *entry, "max_velocity"),
        acceleration=_number(limits, *entry, "max_acceleration"),
        effort=joint.limit.effort if joint.limit else None,
        follows=f"{joint.mimic.multiplier:g} × {joint.mimic.leader} + {joint.mimic.offset:g}" if joint.mimic else "",
        groups=tuple(name for name, group in semantics.groups.items() if joint.name in group.active),
        marks=tuple(
            Mark(f"{group} {name}", positions[joint.name], percent(positions[joint.name]))
            for group, named in states.items()
            for name, positions in named.items()
            if joint.name in positions
        ),
    )
