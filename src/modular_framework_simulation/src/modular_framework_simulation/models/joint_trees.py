# SPDX-License-Identifier: BSD-3-Clause
"""Arranges the links of a model in trees, as physics engines with reduced coordinates need them.

A description may name any link of a joint as its parent, and leave links without a joint. Here every joint leads away
from the root of its tree; links that nothing connects are trees of their own.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_specs import WORLD, Joint, Model


@dataclass(frozen=True, slots=True)
class JointTree:
    """Links that joints connect.

    Attributes:
        root: Name of the link everything hangs on; "world" where the tree is fastened to the world.
        links: Names of its links, in the order of the description; without the world.
        joints: Each from what is nearer to the root to what is further away, nearer ones first.
    """

    root: str
    links: tuple[str, ...]
    joints: tuple[Joint, ...]


def joint_trees(model: Model) -> tuple[JointTree, ...]:
    """Returns the trees of a model; the first one holds its first link.

    Raises:
        DescriptionError: Joints form a closed loop.
    """
    names = [link.name for link in model.links]
    order = {name: number for number, name in enumerate(names)}
    joints_at: dict[str, list[Joint]] = {name: [] for name in (WORLD, *names)}
    for joint in model.joints:
        joints_at[joint.parent].append(joint)
        joints_at[joint.child].append(joint)
    children = {joint.child for joint in model.joints}
    roots = [name for name in names if name not in children]
    left = dict.fromkeys(names)
    trees: list[JointTree] = []
    for root in (*([WORLD] if joints_at[WORLD] else []), *roots, *names):
        if root != WORLD and root not in left:
            continue
        joints = _grown(model, root, joints_at)
        links = sorted({joint.child for joint in joints} | ({root} - {WORLD}), key=order.__getitem__)
        for link in links:
            del left[link]
        trees.append(JointTree(root, tuple(links), joints))
    return tuple(sorted(trees, key=lambda tree: order[tree.links[0]]))


def refuse_loops(model: Model) -> None:
    """Raises DescriptionError where joints of a model that can move form a closed loop."""
    if not model.static:
        joint_trees(model)


def _grown(model: Model, root: str, joints_at: dict[str, list[Joint]]) -> tuple[Joint, ...]:
    """Returns the joints of the tree that grows from a root."""
    grown: list[Joint] = []
    reached, used, waiting = {root}, set[str](), [root]
    while waiting:
        here = waiting.pop(0)
        for joint in joints_at[here]:
            if joint.name in used:
                continue
            used.add(joint.name)
            away = joint if joint.parent == here else _turned_round(model, joint)
            if away.child in reached:
                raise DescriptionError(
                    joint.where or f"{model.source}: joint '{joint.name}'",
                    f"closes a loop of joints of model '{model.name}' through '{away.child}'",
                    "allowed: joints that form trees; a model may be static instead",
                )
            reached.add(away.child)
            grown.append(away)
            waiting.append(away.child)
    return tuple(grown)


def _turned_round(model: Model, joint: Joint) -> Joint:
    """Returns the joint with parent and child exchanged; its position means the same."""
    poses = {link.name: link.pose for link in model.links}
    pose = poses[joint.parent].inverse() @ poses[joint.child] @ joint.pose
    x, y, z = joint.axis
    return dataclasses.replace(joint, parent=joint.child, child=joint.parent, pose=pose, axis=(-x, -y, -z))
