# SPDX-License-Identifier: BSD-3-Clause
"""Finds the arms and grippers of a robot in its kinematic tree."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from modular_framework_core.files.faults import listing, nearest
from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_setup.errors import CreationError
from modular_framework_urdf.robot import Joint

LEAST_JOINTS = 2
"""A serial chain of fewer joints is no arm: a wheel, a lid."""
FLANGES = ("tool0", "tcp", "tool", "flange", "ee_link", "ee", "link_ee", "tip")


@dataclass(frozen=True, slots=True)
class Gripper:
    """Fingers that one joint drives.

    Attributes:
        palm: link that carries the fingers.
        driver: joint that is commanded.
        joints: all its joints, the driver first.
        links: links of the fingers.
        twin: joint that does as the driver does, though the URDF does not say so; empty for none.
    """

    name: str
    palm: str
    driver: str
    joints: tuple[str, ...]
    links: tuple[str, ...]
    twin: str = ""


@dataclass(frozen=True, slots=True)
class Arm:
    """A serial chain.

    Attributes:
        joints: that are driven, from base to tip.
        gripper: name of the one at its end; empty for none.
    """

    name: str
    base: str
    tip: str
    joints: tuple[str, ...]
    gripper: str = ""


@dataclass(frozen=True, slots=True)
class RobotParts:
    """Arms, grippers and the joints that several arms hang on."""

    arms: tuple[Arm, ...]
    grippers: tuple[Gripper, ...]
    torso: tuple[str, ...] = ()

    def gripper_of(self, arm: Arm) -> Gripper | None:
        """Returns the gripper at the end of an arm."""
        return next((item for item in self.grippers if item.name == arm.gripper), None)


def below(tree: RobotTree, link: str) -> list[Joint]:
    """Returns all joints below a link."""
    found = []
    for joint in tree.children(link):
        found += [joint, *below(tree, joint.child)]
    return found


def is_driven(joint: Joint) -> bool:
    """Whether a joint moves by itself."""
    return joint.movable and joint.mimic is None


def find_parts(
    tree: RobotTree, chains: Sequence[tuple[str, str]] = (), fingers: Sequence[Sequence[str]] = ()
) -> RobotParts:
    """Finds arms and grippers.

    Args:
        tree: of the robot.
        chains: base and tip link of each arm; none: they are found.
        fingers: finger links of each gripper; none: they are found, by mimic joints or by pairs of equal joints.

    Raises:
        CreationError: an option names no link of the robot or no chain, or there is no arm.
    """
    for name in (*(link for chain in chains for link in chain), *(link for links in fingers for link in links)):
        if name not in tree.links:
            raise CreationError(f"link '{name}' is not in the URDF; {listing(tree.links)}{nearest(name, tree.links)}")
    sets = [_fingers(tree, links) for links in fingers] if fingers else _mimic_sets(tree) + _twins(tree)
    grippers = _named_grippers([_gripper(tree, joints) for joints in sets])
    if chains:
        return RobotParts(_given_arms(tree, chains, grippers), grippers)
    return _found_arms(tree, grippers)


def _fingers(tree: RobotTree, links: Sequence[str]) -> list[Joint]:
    joints = [joint for link in links if (joint := tree.parent_joint.get(link)) is not None and joint.movable]
    more = [joint for link in links for joint in below(tree, link) if joint.movable]
    found = list({joint.name: joint for joint in (*joints, *more)}.values())
    if not any(map(is_driven, found)):
        raise CreationError(
            f"--gripper {' '.join(links)}: no joint drives these links; name the links that the fingers' joints carry"
        )
    return found


def _mimic_sets(tree: RobotTree) -> list[list[Joint]]:
    """Returns leaders with their followers, where nothing else is driven below the leader."""
    followers: dict[str, list[Joint]] = {}
    for joint in tree.robot.joints:
        leader = joint
        for _ in tree.joints:
            if leader.mimic is None or leader.mimic.leader not in tree.joints:
                break
            leader = tree.joints[leader.mimic.leader]
        if leader is not joint and joint.movable:
            followers.setdefault(leader.name, []).append(joint)
    return [
        [tree.joints[leader], *items]
        for leader, items in followers.items()
        if is_driven(tree.joints[leader]) and not any(map(is_driven, below(tree, tree.joints[leader].child)))
    ]


def _twins(tree: RobotTree) -> list[list[Joint]]:
    """Returns pairs of equal joints on one link, below which nothing else is driven: fingers without a mimic joint."""
    found = []
    followed = {joint.mimic.leader for joint in tree.robot.joints if joint.mimic}
    for link in tree.links:
        ends = [
            joint
            for joint in tree.children(link)
            if is_driven(joint) and joint.name not in followed and not any(map(is_driven, below(tree, joint.child)))
        ]
        if len(ends) == 2 and ends[0].kind == ends[1].kind != "continuous" and ends[0].limit == ends[1].limit:
            found.append(ends)
    return found


def _gripper(tree: RobotTree, joints: Sequence[Joint]) -> Gripper:
    drivers = [joint for joint in joints if is_driven(joint)]
    common = [list(_up_links(tree, joint.parent)) for joint in joints]
    palm = next(link for link in common[0] if all(link in links for links in common))
    names = {joint.name for joint in joints}
    links = [joint.child for joint in joints]
    links += [joint.child for link in links for joint in below(tree, link) if joint.name not in names]
    ordered = [drivers[0].name, *(joint.name for joint in joints if joint is not drivers[0])]
    twin = drivers[1].name if len(drivers) == 2 == len(joints) else ""
    if len(drivers) > 1 and not twin:
        raise CreationError(
            f"the gripper on link '{palm}' has {len(drivers)} driven joints "
            f"({', '.join(item.name for item in drivers)}); one may be driven, the others follow it by <mimic>; add "
            "<mimic> to the URDF, or name the fingers by --gripper"
        )
    return Gripper("gripper", palm, drivers[0].name, tuple(ordered), tuple(dict.fromkeys(links)), twin)


def _up_links(tree: RobotTree, link: str) -> Iterable[str]:
    yield link
    for joint in tree.up(link):
        yield joint.parent


def _common_prefix(names: Sequence[str]) -> str:
    """Returns what all names begin with, up to a separator."""
    start = os.path.commonprefix(list(names))
    return start[: start.rfind("_") + 1]


def _distinct(prefixes: Sequence[str], noun: str) -> list[str]:
    """Returns a name for each part: the noun, with what its joints begin with where there are several."""
    if len(prefixes) == 1:
        return [noun]
    sides = [_side(prefix, prefixes) for prefix in prefixes]
    if all(sides) and len(set(sides)) == len(sides):
        return [f"{side}_{noun}" for side in sides]
    return [f"{noun}_{number}" for number in range(1, len(prefixes) + 1)]


def _side(prefix: str, prefixes: Sequence[str]) -> str:
    return prefix[len(_common_prefix(prefixes)) :].strip("_").partition("_")[0]


def _named_grippers(grippers: Sequence[Gripper]) -> tuple[Gripper, ...]:
    names = _distinct([_common_prefix(item.joints) for item in grippers], "gripper")
    return tuple(
        Gripper(name, item.palm, item.driver, item.joints, item.links, item.twin)
        for name, item in zip(names, grippers, strict=True)
    )


def _given_arms(tree: RobotTree, chains: Sequence[tuple[str, str]], grippers: Sequence[Gripper]) -> tuple[Arm, ...]:
    paths = []
    for base, tip in chains:
        path = tree.chain(base, tip)
        driven = [joint.name for joint in path or () if is_driven(joint)]
        if not driven:
            raise CreationError(
                f"--arm {base} {tip}: no joint that moves is between them; '{tip}' must hang below '{base}'; exchange "
                "or correct the links"
            )
        paths.append(driven)
    names = _distinct([_common_prefix(path) for path in paths], "arm")
    return tuple(
        Arm(name, base, tip, tuple(path), _gripper_at(tree, tip, path[-1], grippers))
        for name, (base, tip), path in zip(names, chains, paths, strict=True)
    )


def _gripper_at(tree: RobotTree, tip: str, last_joint: str, grippers: Sequence[Gripper]) -> str:
    """Returns the name of the gripper that the last joint of an arm carries."""
    for item in grippers:
        above = next((joint for joint in tree.up(item.palm) if is_driven(joint)), None)
        if above is not None and above.name == last_joint or item.palm == tip:
            return item.name
    return ""


def _found_arms(tree: RobotTree, grippers: tuple[Gripper, ...]) -> RobotParts:
    taken = {name for item in grippers for name in item.joints}
    ends = [(item.palm, item.name) for item in grippers]
    for joint in tree.robot.joints:
        if is_driven(joint) and joint.name not in taken:
            lower = [item for item in below(tree, joint.child) if is_driven(item)]
            if not lower:
                ends.append((joint.child, ""))
    ends = [(link, name) for link, name in ends if name or not _carries(tree, link, ends)]
    paths = [[joint.name for joint in reversed(list(tree.up(link))) if is_driven(joint)] for link, _ in ends]
    shared = {name for path in paths for name in path if sum(name in other for other in paths) > 1}
    chains = [
        (own, *end)
        for path, end in zip(paths, ends, strict=True)
        if len(own := [name for name in path if name not in shared]) >= LEAST_JOINTS
    ]
    if not chains:
        joints = [joint.name for joint in tree.robot.joints if is_driven(joint)]
        raise CreationError(
            f"no arm is found: no serial chain of {LEAST_JOINTS} or more joints among {', '.join(joints) or 'no joint'}"
            "; name it by --arm BASE TIP"
        )
    names = _distinct([_common_prefix(own) for own, _, _ in chains], "arm")
    arms = tuple(
        Arm(name, tree.joints[own[0]].parent, tip_of(tree, link), tuple(own), gripper)
        for name, (own, link, gripper) in zip(names, chains, strict=True)
    )
    used = {joint for arm in arms for joint in arm.joints}
    torso = [joint.name for joint in tree.robot.joints if joint.name in shared and joint.name not in used]
    return RobotParts(arms, grippers, tuple(torso))


def _carries(tree: RobotTree, link: str, ends: Sequence[tuple[str, str]]) -> bool:
    """Whether a gripper hangs on a link."""
    return any(name and (palm == link or tree.chain(link, palm)) for palm, name in ends)


def tip_of(tree: RobotTree, link: str) -> str:
    """Returns the frame at the end of a link: one fixed to it that is called a flange or has no shape, else itself."""
    fixed = [
        joint.child
        for joint in below(tree, link)
        if not tree.children(joint.child) and all(item.kind == "fixed" for item in tree.chain(link, joint.child) or ())
    ]
    for word in FLANGES:
        for name in fixed:
            if name == word or name.endswith(f"_{word}"):
                return name
    frames = [name for name in fixed if not tree.links[name].collisions and not tree.links[name].visuals]
    return frames[-1] if frames else link
