# SPDX-License-Identifier: BSD-3-Clause
"""Finds the arms and grippers of a robot in its kinematic tree."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_setup.errors import CreationError
from modular_framework_urdf.mirrored_joints import mirror_multiplier
from modular_framework_urdf.robot import Joint

MIN_ARM_JOINTS = 2
"""Minimum number of joints of an arm; shorter chains are wheels or lids."""
FLANGES = ("tool0", "tcp", "tool", "flange", "ee_link", "ee", "link_ee", "tip")


@dataclass(frozen=True, slots=True)
class Gripper:
    """A gripper driven by one joint.

    Attributes:
        name: Name of the gripper.
        palm: Parent link of the fingers.
        driver: Commanded joint.
        joints: All joints, the driver first.
        links: Links of the fingers, including the fixed jaw beside a single moving finger.
        twin: Second finger joint that must mimic the driver but has no <mimic> in the URDF; "" for none.
        twin_multiplier: Multiplier of the <mimic> of the twin.
    """

    name: str
    palm: str
    driver: str
    joints: tuple[str, ...]
    links: tuple[str, ...]
    twin: str = ""
    twin_multiplier: float = 1.0


@dataclass(frozen=True, slots=True)
class Arm:
    """A serial chain.

    Attributes:
        name: Name of the arm.
        base: Base link.
        tip: Tip link.
        joints: Driven joints from base to tip.
        gripper: Name of the gripper at the tip; "" for none.
    """

    name: str
    base: str
    tip: str
    joints: tuple[str, ...]
    gripper: str = ""


@dataclass(frozen=True, slots=True)
class RobotParts:
    """Arms and grippers of a robot.

    Attributes:
        arms: Arms.
        grippers: Grippers.
        torso: Joints shared by several arms.
    """

    arms: tuple[Arm, ...]
    grippers: tuple[Gripper, ...]
    torso: tuple[str, ...] = ()

    def gripper_of(self, arm: Arm) -> Gripper | None:
        """Returns the gripper of an arm, or None."""
        return next((item for item in self.grippers if item.name == arm.gripper), None)


def joints_below(tree: RobotTree, link: str) -> list[Joint]:
    """Returns all joints below a link."""
    joints = []
    for joint in tree.children(link):
        joints += [joint, *joints_below(tree, joint.child)]
    return joints


def is_driven(joint: Joint) -> bool:
    """Returns whether a joint is movable and not a mimic joint."""
    return joint.is_movable and joint.mimic is None


def find_parts(
    tree: RobotTree, chains: Sequence[tuple[str, str]] = (), fingers: Sequence[Sequence[str]] = ()
) -> RobotParts:
    """Finds the arms and grippers of a robot.

    Args:
        tree: Kinematic tree of the robot.
        chains: Base and tip link of each arm; empty to find the arms.
        fingers: Finger links of each gripper; empty to find grippers by mimic joints or pairs of equal joints.

    Raises:
        CreationError: An option names an unknown link or an invalid chain, or there is no arm.
    """
    for name in (*(link for chain in chains for link in chain), *(link for links in fingers for link in links)):
        if name not in tree.links:
            raise CreationError(f"link '{name}' is not in the URDF; {listing(tree.links)}{nearest(name, tree.links)}")
    joint_sets = [_finger_joints(tree, links) for links in fingers] if fingers else _mimic_sets(tree) + _twins(tree)
    grippers = _named_grippers([_gripper(tree, joints) for joints in joint_sets])
    if chains:
        return RobotParts(_given_arms(tree, chains, grippers), grippers)
    return _found_arms(tree, grippers)


def _finger_joints(tree: RobotTree, links: Sequence[str]) -> list[Joint]:
    parents = [joint for link in links if (joint := tree.parent_joint.get(link)) is not None and joint.is_movable]
    descendants = [joint for link in links for joint in joints_below(tree, link) if joint.is_movable]
    joints = list({joint.name: joint for joint in (*parents, *descendants)}.values())
    if not any(map(is_driven, joints)):
        raise CreationError(
            f"--gripper {' '.join(links)}: no joint drives these links; name the child links of the fingers' joints"
        )
    return joints


def _mimic_sets(tree: RobotTree) -> list[list[Joint]]:
    """Returns each leading joint with its mimic joints, unless the leading joint has other driven joints below it."""
    followers: dict[str, list[Joint]] = {}
    for joint in tree.robot.joints:
        leader = joint
        for _ in tree.joints:
            if leader.mimic is None or leader.mimic.leader not in tree.joints:
                break
            leader = tree.joints[leader.mimic.leader]
        if leader is not joint and joint.is_movable:
            followers.setdefault(leader.name, []).append(joint)
    return [
        [tree.joints[leader], *items]
        for leader, items in followers.items()
        if is_driven(tree.joints[leader]) and not any(map(is_driven, joints_below(tree, tree.joints[leader].child)))
    ]


def _twins(tree: RobotTree) -> list[list[Joint]]:
    """Returns pairs of mirrored, last driven joints on the same link, which are fingers without a mimic joint."""
    twins = []
    leaders = {joint.mimic.leader for joint in tree.robot.joints if joint.mimic}
    for link in tree.links:
        ends = [
            joint
            for joint in tree.children(link)
            if is_driven(joint)
            and joint.name not in leaders
            and not any(map(is_driven, joints_below(tree, joint.child)))
        ]
        if len(ends) == 2 and ends[0].kind != "continuous" and mirror_multiplier(*ends):
            twins.append(ends)
    return twins


def _gripper(tree: RobotTree, joints: Sequence[Joint]) -> Gripper:
    drivers = [joint for joint in joints if is_driven(joint)]
    ancestors = [list(_ancestors(tree, joint.parent)) for joint in joints]
    palm = next(link for link in ancestors[0] if all(link in links for links in ancestors))
    names = {joint.name for joint in joints}
    links = [joint.child for joint in joints]
    links += [joint.child for link in links for joint in joints_below(tree, link) if joint.name not in names]
    roots = {next(above.name for above in tree.up(joint.child) if above.parent == palm) for joint in joints}
    if len(roots) == 1:
        links += _fixed_jaws(tree, palm)
    ordered = [drivers[0].name, *(joint.name for joint in joints if joint is not drivers[0])]
    twin = drivers[1].name if len(drivers) == 2 == len(joints) else ""
    multiplier = mirror_multiplier(*drivers) or 1.0 if twin else 1.0
    if len(drivers) > 1 and not twin:
        raise CreationError(
            f"the gripper on link '{palm}' has {len(drivers)} driven joints "
            f"({', '.join(item.name for item in drivers)}); only one may be driven, the others must mimic it; add "
            "<mimic> to the URDF, or name the fingers by --gripper"
        )
    return Gripper("gripper", palm, drivers[0].name, tuple(ordered), tuple(dict.fromkeys(links)), twin, multiplier)


def _fixed_jaws(tree: RobotTree, palm: str) -> list[str]:
    """Returns the links with shapes that are fixed to a palm and farther from the base."""
    jaws = []
    for joint in tree.children(palm):
        if joint.kind == "fixed":
            jaws += [joint.child, *_fixed_jaws(tree, joint.child)]
    return [link for link in jaws if tree.links[link].collisions]


def _ancestors(tree: RobotTree, link: str) -> Iterable[str]:
    yield link
    for joint in tree.up(link):
        yield joint.parent


def _common_prefix(names: Sequence[str]) -> str:
    """Returns the common prefix of names, up to the last underscore."""
    prefix = os.path.commonprefix(list(names))
    return prefix[: prefix.rfind("_") + 1]


def _distinct(prefixes: Sequence[str], noun: str) -> list[str]:
    """Returns a distinct name for each part: the noun, for several parts with the prefix of the joints or a number."""
    if len(prefixes) == 1:
        return [noun]
    sides = [_side(prefix, prefixes) for prefix in prefixes]
    if all(sides) and len(set(sides)) == len(sides):
        return [f"{side}_{noun}" for side in sides]
    return [f"{noun}_{index}" for index in range(1, len(prefixes) + 1)]


def _side(prefix: str, prefixes: Sequence[str]) -> str:
    return prefix[len(_common_prefix(prefixes)) :].strip("_").partition("_")[0]


def _named_grippers(grippers: Sequence[Gripper]) -> tuple[Gripper, ...]:
    names = _distinct([_common_prefix(item.joints) for item in grippers], "gripper")
    return tuple(replace(item, name=name) for name, item in zip(names, grippers, strict=True))


def _given_arms(tree: RobotTree, chains: Sequence[tuple[str, str]], grippers: Sequence[Gripper]) -> tuple[Arm, ...]:
    paths = []
    for base, tip in chains:
        path = tree.chain(base, tip)
        driven = [joint.name for joint in path or () if is_driven(joint)]
        if not driven:
            raise CreationError(
                f"--arm {base} {tip}: no driven joint is between them; '{tip}' must be a descendant of '{base}'; swap "
                "or correct the links"
            )
        paths.append(driven)
    names = _distinct([_common_prefix(path) for path in paths], "arm")
    return tuple(
        Arm(name, base, tip, tuple(path), _gripper_at(tree, tip, path[-1], grippers))
        for name, (base, tip), path in zip(names, chains, paths, strict=True)
    )


def _gripper_at(tree: RobotTree, tip: str, last_joint: str, grippers: Sequence[Gripper]) -> str:
    """Returns the name of the gripper at the end of an arm, or ""."""
    for item in grippers:
        parent = next((joint for joint in tree.up(item.palm) if is_driven(joint)), None)
        if parent is not None and parent.name == last_joint or item.palm == tip:
            return item.name
    return ""


def _found_arms(tree: RobotTree, grippers: tuple[Gripper, ...]) -> RobotParts:
    gripper_joints = {name for item in grippers for name in item.joints}
    ends = [(item.palm, item.name) for item in grippers]
    for joint in tree.robot.joints:
        if is_driven(joint) and joint.name not in gripper_joints:
            descendants = [item for item in joints_below(tree, joint.child) if is_driven(item)]
            if not descendants:
                ends.append((joint.child, ""))
    ends = [(link, name) for link, name in ends if name or not _carries(tree, link, ends)]
    paths = [[joint.name for joint in reversed(list(tree.up(link))) if is_driven(joint)] for link, _ in ends]
    shared = {name for path in paths for name in path if sum(name in other for other in paths) > 1}
    chains = [
        (own_joints, *end)
        for path, end in zip(paths, ends, strict=True)
        if len(own_joints := [name for name in path if name not in shared]) >= MIN_ARM_JOINTS
    ]
    if not chains:
        joints = [joint.name for joint in tree.robot.joints if is_driven(joint)]
        raise CreationError(
            f"no arm is found: no serial chain of {MIN_ARM_JOINTS} or more joints among {', '.join(joints) or 'none'}"
            "; name the arm by --arm BASE TIP"
        )
    names = _distinct([_common_prefix(own_joints) for own_joints, _, _ in chains], "arm")
    arms = tuple(
        Arm(name, tree.joints[own_joints[0]].parent, tip_of(tree, link), tuple(own_joints), gripper)
        for name, (own_joints, link, gripper) in zip(names, chains, strict=True)
    )
    used = {joint for arm in arms for joint in arm.joints}
    torso = [joint.name for joint in tree.robot.joints if joint.name in shared and joint.name not in used]
    return RobotParts(arms, grippers, tuple(torso))


def _carries(tree: RobotTree, link: str, ends: Sequence[tuple[str, str]]) -> bool:
    """Returns whether a gripper is attached to a link or a descendant."""
    return any(name and (palm == link or tree.chain(link, palm)) for palm, name in ends)


def tip_of(tree: RobotTree, link: str) -> str:
    """Returns the tip frame of a link: a fixed descendant with a flange name or without shape, else the link itself."""
    fixed = [
        joint.child
        for joint in joints_below(tree, link)
        if not tree.children(joint.child) and all(item.kind == "fixed" for item in tree.chain(link, joint.child) or ())
    ]
    for word in FLANGES:
        for name in fixed:
            if name == word or name.endswith(f"_{word}"):
                return name
    frames = [name for name in fixed if not tree.links[name].collisions and not tree.links[name].visuals]
    return frames[-1] if frames else link
