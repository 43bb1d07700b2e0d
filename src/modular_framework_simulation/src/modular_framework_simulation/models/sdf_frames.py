# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the frames of an SDF model: `<pose relative_to="...">` may chain through links, frames and inner models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose, normalised_quaternion
from modular_framework_simulation.models.sdf_specs import WORLD
from modular_framework_simulation.models.xml_nodes import XmlNode

SCOPE = "::"
"""Stands between the name of a model and that of what is in it."""

MODEL_FRAME = "__model__"
_FRAME_TAGS = ("link", "frame")


def pose_of(node: XmlNode) -> Pose:
    """Returns the pose an element's text gives: x y z [m] roll pitch yaw [rad]; an empty text is the identity.

    The attributes `degrees` and `rotation_format` of SDF 1.9 are followed.

    Raises:
        DescriptionError: The text is not as many numbers as it needs to be.
    """
    if not node.text.strip():
        return Pose()
    rotation = node.attributes.get("rotation_format", "euler_rpy")
    if rotation == "quat_xyzw":
        x, y, z, *quaternion = node.numbers(7)
        qx, qy, qz, qw = quaternion
        try:
            return Pose((x, y, z), normalised_quaternion((qx, qy, qz, qw)))
        except ValueError as error:
            raise DescriptionError(node.where, f"got '{node.text.strip()}'", str(error)) from error
    if rotation != "euler_rpy":
        problem = f"got rotation_format '{rotation}'"
        raise DescriptionError(node.where, problem, "allowed: euler_rpy, quat_xyzw")
    x, y, z, roll, pitch, yaw = node.numbers(6)
    if node.attributes.get("degrees", "false").strip().lower() in ("true", "1"):
        roll, pitch, yaw = math.radians(roll), math.radians(pitch), math.radians(yaw)
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


def base_of(pose: XmlNode) -> str:
    """Returns the name of the frame a pose is relative to; empty where it does not say."""
    return pose.attributes.get("relative_to", pose.attributes.get("frame", ""))


@dataclass(frozen=True, slots=True)
class InnerModel:
    """A model inside another model, or in a world.

    Attributes:
        frames: Its own frames.
        pose: Where its `placement_frame` is; None for the origin of what holds it.
        placement_frame: The frame of the model that the pose is of; empty for the frame of the model.
    """

    frames: FrameTree
    pose: XmlNode | None
    placement_frame: str


class FrameTree:
    """The named frames of one model, or of a world.

    Args:
        holder: The element of the model or world.
        inner: The models in it, by name.
        canonical_link: The link that `__model__` belongs to; empty where there is none.
    """

    def __init__(self, holder: XmlNode, inner: Mapping[str, InnerModel], canonical_link: str = "") -> None:
        self._holder = holder
        self._inner = inner
        self._canonical_link = canonical_link
        named = [child for child in holder.children if child.attributes.get("name")]
        # A joint may have the name of a link: then the name stands for the link.
        self._joints = {child.attributes["name"]: child for child in named if child.tag == "joint"}
        self._nodes = {child.attributes["name"]: child for child in named if child.tag in _FRAME_TAGS}

    def refuse_circles(self) -> None:
        """Refuses frames that are defined by each other in a circle, also those that nothing uses.

        Raises:
            DescriptionError: Names the circle.
        """
        for name in self._nodes:
            self.pose_in_model(name)

    def _base_of(self, pose: XmlNode) -> str:
        """Returns the frame that a pose is relative to; the attribute `frame` of old files may name nothing."""
        base, outer = base_of(pose), base_of(pose).partition(SCOPE)[0]
        known = {"", MODEL_FRAME, *self._nodes, *self._joints, *self._inner}
        return base if "relative_to" in pose.attributes or outer in known else ""

    def pose_in_model(self, name: str) -> Pose:
        """Returns the pose of a link, frame, joint or inner model in the frame of the model.

        Args:
            name: One of them, with "inner::" before it where it is in an inner model; empty for the model itself.

        Raises:
            DescriptionError: The name is unknown, or the frames are defined by each other in a circle.
        """
        return self._pose(name, ())

    def joint_pose_in_model(self, joint: XmlNode) -> Pose:
        """Returns the pose of a joint in the model frame; by default that of its child."""
        return self._pose_of_node(joint, ("joint " + joint.name(),))

    def placed(self, pose: XmlNode | None, base: str = "") -> Pose:
        """Returns the pose an element gives, in the frame of the model.

        Args:
            pose: The <pose>; None for the identity.
            base: The frame it is relative to where it does not say itself.
        """
        if pose is None:
            return self.pose_in_model(base)
        return self.pose_in_model(self._base_of(pose) or base) @ pose_of(pose)

    def pose_in_link(self, link: str, pose: XmlNode | None) -> Pose:
        """Returns the pose of something in a link, in the frame of the link."""
        if pose is None:
            return Pose()
        base = self._base_of(pose)
        if base in ("", link):
            return pose_of(pose)
        return self.pose_in_model(link).inverse() @ self.placed(pose)

    def link_of(self, node: XmlNode) -> str:
        """Returns the link that the <parent> or <child> of a joint means; frames and models stand for theirs.

        Raises:
            DescriptionError: It names nothing that has a link.
        """
        name = node.text.strip()
        if name == WORLD:
            return WORLD
        link = self._link(name, ())
        prefix = self._holder.attributes.get("name", "") + SCOPE
        if link is None and name.startswith(prefix):  # old files write the name of the model before it
            link = self._link(name.removeprefix(prefix), ())
        if link is None:
            raise DescriptionError(node.where, f"'{name}' is no link", f"allowed: {', '.join(self._links())}")
        return link

    def _links(self) -> list[str]:
        own = [name for name, node in self._nodes.items() if node.tag == "link"]
        inner = [f"{name}{SCOPE}{link}" for name, model in self._inner.items() for link in model.frames._links()]
        return own + inner

    def _link(self, name: str, visited: tuple[str, ...]) -> str | None:
        """Returns the link a frame is attached to, None where there is none of that name."""
        if name in visited:
            raise DescriptionError(self._holder.where, f"'{name}' is attached to itself", "break the circle")
        if name in ("", MODEL_FRAME):
            return self._canonical_link or None
        if name in self._nodes:
            node = self._nodes[name]
            return name if node.tag == "link" else self._link(node.attributes.get("attached_to", ""), (*visited, name))
        if name in self._inner:
            link = self._inner[name].frames._link("", ())
            return None if link is None else f"{name}{SCOPE}{link}"
        inner, separator, rest = name.partition(SCOPE)
        if separator and inner in self._inner:
            link = self._inner[inner].frames._link(rest, ())
            return None if link is None else f"{inner}{SCOPE}{link}"
        if name in self._joints:
            return self._link(self._joints[name].require("child").text.strip(), (*visited, name))
        return None

    def _pose(self, name: str, visited: tuple[str, ...]) -> Pose:
        if name in ("", MODEL_FRAME) or (name == WORLD and self._holder.tag == "world"):
            return Pose()
        if name in visited:
            circle = " -> ".join([*visited, name])
            raise DescriptionError(self._where(name), f"its pose depends on itself ({circle})", "break the circle")
        if name in self._inner:
            return self._pose_of_inner(self._inner[name], (*visited, name))
        inner, separator, rest = name.partition(SCOPE)
        if separator and inner in self._inner:
            return self._pose(inner, visited) @ self._inner[inner].frames.pose_in_model(rest)
        node = self._nodes.get(name) or self._joints.get(name)
        if node is None:
            known = ", ".join([MODEL_FRAME, *self._nodes, *self._joints, *self._inner])
            raise DescriptionError(self._holder.where, f"a pose is relative to '{name}'", f"allowed: {known}")
        return self._pose_of_node(node, (*visited, name))

    def _where(self, name: str) -> str:
        node = self._nodes.get(name) or self._joints.get(name) or self._holder
        return node.where

    def _pose_of_node(self, node: XmlNode, visited: tuple[str, ...]) -> Pose:
        pose = node.find("pose")
        base = self._base_of(pose) if pose is not None else ""
        if not base and node.tag == "joint":
            base = node.require("child").text.strip()
            if base not in self._nodes and base not in self._inner:  # perhaps with the name of the model before it
                base = self._link_named(node.require("child"))
        elif not base and node.tag == "frame":
            base = node.attributes.get("attached_to", "")
        return self._pose(base, visited) @ (pose_of(pose) if pose is not None else Pose())

    def _link_named(self, node: XmlNode) -> str:
        return self.link_of(node) if SCOPE in node.text else node.text.strip()

    def _pose_of_inner(self, model: InnerModel, visited: tuple[str, ...]) -> Pose:
        placed = Pose()
        if model.pose is not None:
            placed = self._pose(self._base_of(model.pose), visited) @ pose_of(model.pose)
        if not model.placement_frame:
            return placed
        return placed @ model.frames.pose_in_model(model.placement_frame).inverse()
