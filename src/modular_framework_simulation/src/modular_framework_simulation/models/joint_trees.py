# SPDX-License-Identifier: BSD-3-Clause
"""Arranges the links of a model in trees, as required by physics engines with reduced coordinates.

A description may call either link of a joint the parent, and may contain links without joints. In a tree, every joint
leads away from the root; a link without joints is a separate tree.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.sdf_specs import WORLD, Joint, Model


@dataclass(frozen=True, slots=True)
class JointTree:
    """A tree of links and joints.

    Attributes:
        root: Name of the root link; "world" for a tree that is fixed to the world.
        links: Link names without the world, in the order of the description.
        joints: Joints sorted by distance from the root, each with the link nearer to the root as parent.
    """

    root: str
    links: tuple[str, ...]
    joints: tuple[Joint, ...]


def joint_trees(model: Model) -> tuple[JointTree, ...]:
    """Returns the trees of a model; the first tree contains the first link.

    Raises:
        DescriptionError: The joints form a closed loop.
    """
    names = [link.name for link in model.links]
    order = {name: index for index, name in enumerate(names)}
    joints_of: dict[str, list[Joint]] = {name: [] for name in (WORLD, *names)}
    for joint in model.joints:
        joints_of[joint.parent].append(joint)
        joints_of[joint.child].append(joint)
    children = {joint.child for joint in model.joints}
    roots = [name for name in names if name not in children]
    unassigned = dict.fromkeys(names)
    trees: list[JointTree] = []
    for root in (*([WORLD] if joints_of[WORLD] else []), *roots, *names):
        if root != WORLD and root not in unassigned:
            continue
        joints = _tree_joints(model, root, joints_of)
        links = sorted({joint.child for joint in joints} | ({root} - {WORLD}), key=order.__getitem__)
        for link in links:
            del unassigned[link]
        trees.append(JointTree(root, tuple(links), joints))
    return tuple(sorted(trees, key=lambda tree: order[tree.links[0]]))


def refuse_loops(model: Model) -> None:
    """Raises DescriptionError if the joints of a movable model form a closed loop."""
    if not model.static:
        joint_trees(model)


def _tree_joints(model: Model, root: str, joints_of: dict[str, list[Joint]]) -> tuple[Joint, ...]:
    """Returns the joints of the tree with the given root."""
    joints: list[Joint] = []
    reached, used, queue = {root}, set[str](), [root]
    while queue:
        link = queue.pop(0)
        for joint in joints_of[link]:
            if joint.name in used:
                continue
            used.add(joint.name)
            outward = joint if joint.parent == link else _reversed_joint(model, joint)
            if outward.child in reached:
                raise DescriptionError(
                    joint.location or f"{model.source}: joint '{joint.name}'",
                    f"closes a loop of joints of model '{model.name}' through '{outward.child}'",
                    "allowed: joints that form trees, or a static model",
                )
            reached.add(outward.child)
            joints.append(outward)
            queue.append(outward.child)
    return tuple(joints)


def _reversed_joint(model: Model, joint: Joint) -> Joint:
    """Returns the joint with parent and child exchanged and the same meaning of its position."""
    poses = {link.name: link.pose for link in model.links}
    pose = poses[joint.parent].inverse() @ poses[joint.child] @ joint.pose
    x, y, z = joint.axis
    return dataclasses.replace(joint, parent=joint.child, child=joint.parent, pose=pose, axis=(-x, -y, -z))
