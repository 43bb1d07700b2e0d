# SPDX-License-Identifier: BSD-3-Clause
"""Finds the frames that move with the robot: its links, and the held objects with their subframes."""

from __future__ import annotations

from modular_framework_planning.constraints.constraint_kinds import FrameOnRobot
from modular_framework_planning.errors import ErrorCode, UnknownNameError
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


def frame_on_robot(scene: PlanningScene, name: str) -> FrameOnRobot:
    """Returns a frame that moves with the robot (link, attached object) or is fixed (any other frame).

    Raises:
        UnknownNameError: The frame does not exist.
    """
    name = name.removeprefix("/")
    pose = scene.frame_transform(name)
    holder = holding_link(scene, name)
    if not holder:
        return FrameOnRobot(name or scene.model.planning_frame, 0, pose)
    frame = scene.model.pin_model.frames[scene.model.frame_ids[holder]]
    placement = frame.placement * scene.frame_transform(holder).actInv(pose)
    return FrameOnRobot(name, int(frame.parentJoint), placement)


def holding_link(scene: PlanningScene, name: str) -> str:
    """Returns the link that a frame is fixed to: the link itself, or the link that holds the object; else empty."""
    name = name.removeprefix("/")
    if scene.model.has_link(name):
        return name
    if name in scene.objects:
        return ""
    return next(
        (
            item.link
            for held, item in scene.attached.items()
            if name == held or (name.startswith(f"{held}/") and name.removeprefix(f"{held}/") in item.body.subframes)
        ),
        "",
    )


def require_holding_link(scene: PlanningScene, name: str, noun: str) -> str:
    """Returns the link that a frame is fixed to, as `holding_link`.

    Args:
        scene: Planning scene.
        name: Name of a link, a held object or one of its subframes.
        noun: Description of the name, for the error message.

    Raises:
        UnknownNameError: No such frame moves with the robot.
    """
    link = holding_link(scene, name)
    if not link:
        held = [f"{item.name}/{inner}" for item in scene.attached.values() for inner in item.body.subframes]
        known = [*scene.model.frame_ids, *scene.attached, *held]
        raise UnknownNameError(ErrorCode.INVALID_LINK_NAME, noun, name, known)
    return link
