# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the frames of an SDF model; `<pose relative_to="...">` may chain through links, frames and inner models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose, normalised_quaternion
from modular_framework_simulation.models.sdf_specs import WORLD
from modular_framework_simulation.models.xml_nodes import XmlNode

SCOPE = "::"
"""Separator between the name of a model and the name of an element of the model."""

MODEL_FRAME = "__model__"
_FRAME_TAGS = ("link", "frame")


MAX_COORDINATE = 1e6
"""Maximum magnitude of a number in a pose [m or rad]; beyond, positions are no longer precise to 1 um."""


def pose_of(node: XmlNode) -> Pose:
    """Parses an element's text as a pose: x y z [m] roll pitch yaw [rad]; an empty text is the identity.

    The attributes `degrees` and `rotation_format` of SDF 1.9 are supported.

    Raises:
        DescriptionError: The text has the wrong number of values, or a value is too large.
    """
    if not node.text.strip():
        return Pose()
    rotation = node.attributes.get("rotation_format", "euler_rpy")
    if rotation == "quat_xyzw":
        x, y, z, *quaternion = _bounded_numbers(node, 7)
        qx, qy, qz, qw = quaternion
        try:
            return Pose((x, y, z), normalised_quaternion((qx, qy, qz, qw)))
        except ValueError as error:
            raise DescriptionError(node.location, f"got '{node.text.strip()}'", str(error)) from error
    if rotation != "euler_rpy":
        problem = f"got rotation_format '{rotation}'"
        raise DescriptionError(node.location, problem, "allowed: euler_rpy, quat_xyzw")
    x, y, z, roll, pitch, yaw = _bounded_numbers(node, 6)
    if node.attributes.get("degrees", "false").strip().lower() in ("true", "1"):
        roll, pitch, yaw = math.radians(roll), math.radians(pitch), math.radians(yaw)
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


def _bounded_numbers(node: XmlNode, count: int) -> tuple[float, ...]:
    values = node.numbers(count)
    if max(map(abs, values)) > MAX_COORDINATE:
        problem = f"got '{node.text.strip()}'"
        raise DescriptionError(node.location, problem, f"allowed: numbers up to {MAX_COORDINATE:,.0f} in magnitude")
    return values


def base_of(pose: XmlNode) -> str:
    """Returns the name of the frame that a pose is relative to; empty if not specified."""
    return pose.attributes.get("relative_to", pose.attributes.get("frame", ""))


@dataclass(frozen=True, slots=True)
class InnerModel:
    """Model inside another model or a world.

    Attributes:
        frames: Frames of the inner model.
        pose: <pose> of the placement frame in the outer model; None for the origin.
        placement_frame: Frame of the inner model at `pose`; empty for the model frame.
    """

    frames: FrameTree
    pose: XmlNode | None
    placement_frame: str


class FrameTree:
    """Named frames of a model or world.

    Args:
        holder: Element of the model or world.
        inner: Inner models, by name.
        canonical_link: Link that `__model__` is attached to; empty for a world.
    """

    def __init__(self, holder: XmlNode, inner: Mapping[str, InnerModel], canonical_link: str = "") -> None:
        self._holder = holder
        self._inner = inner
        self._canonical_link = canonical_link
        named = [child for child in holder.children if child.attributes.get("name")]
        # A joint may have the same name as a link; the name then refers to the link.
        self._joints = {child.attributes["name"]: child for child in named if child.tag == "joint"}
        self._nodes = {child.attributes["name"]: child for child in named if child.tag in _FRAME_TAGS}

    def refuse_circles(self) -> None:
        """Checks that no frames, used or unused, are defined by or attached to each other in a circle.

        Raises:
            DescriptionError: The frames form a circle, which the text names, or a frame is attached to nothing.
        """
        for name, node in self._nodes.items():
            self.pose_in_model(name)
            attached_to = node.attributes.get("attached_to", "")
            if attached_to not in ("", WORLD):
                self._pose(attached_to, ())  # fails if there is no such frame
                self._link(name, ())

    def _base_of(self, pose: XmlNode) -> str:
        """Returns the base frame of a pose; empty if the attribute `frame` of an old file names an unknown frame."""
        base, outer = base_of(pose), base_of(pose).partition(SCOPE)[0]
        known = outer in ("", MODEL_FRAME) or any(outer in names for names in (self._nodes, self._joints, self._inner))
        return base if known or "relative_to" in pose.attributes else ""

    def pose_in_model(self, name: str) -> Pose:
        """Returns the pose of a link, frame, joint or inner model in the model frame.

        Args:
            name: Name of the element, with the prefix "inner::" in an inner model; empty for the model.

        Raises:
            DescriptionError: The name is unknown, or the frames are defined by each other in a circle.
        """
        return self._pose(name, ())

    def joint_pose_in_model(self, joint: XmlNode) -> Pose:
        """Returns the pose of a joint in the model frame; the default is the pose of its child."""
        return self._pose_of_node(joint, ("joint " + joint.name(),))

    def pose_of_element(self, pose: XmlNode | None, base: str = "") -> Pose:
        """Returns the pose of an element in the model frame.

        Args:
            pose: The <pose> element; None for the identity.
            base: Base frame of a pose without its own base frame.
        """
        if pose is None:
            return self.pose_in_model(base)
        return self.pose_in_model(self._base_of(pose) or base) @ pose_of(pose)

    def pose_in_link(self, link: str, pose: XmlNode | None) -> Pose:
        """Returns the pose of a link's child element in the link frame."""
        if pose is None:
            return Pose()
        base = self._base_of(pose)
        if base in ("", link):
            return pose_of(pose)
        return self.pose_in_model(link).inverse() @ self.pose_of_element(pose)

    def link_of(self, node: XmlNode) -> str:
        """Returns the link that a joint's <parent> or <child> refers to, also through frames and models.

        Raises:
            DescriptionError: The name does not refer to a link.
        """
        name = node.text.strip()
        if name == WORLD:
            return WORLD
        link = self._link(name, ())
        prefix = self._holder.attributes.get("name", "") + SCOPE
        if link is None and name.startswith(prefix):  # old files add the model's name as a prefix
            link = self._link(name.removeprefix(prefix), ())
        if link is None:
            raise DescriptionError(node.location, f"'{name}' is not a link", f"allowed: {', '.join(self._links())}")
        return link

    def _links(self) -> list[str]:
        own = [name for name, node in self._nodes.items() if node.tag == "link"]
        inner = [f"{name}{SCOPE}{link}" for name, model in self._inner.items() for link in model.frames._links()]
        return own + inner

    def _link(self, name: str, visited: tuple[str, ...]) -> str | None:
        """Returns the link that a frame is attached to; None for an unknown name."""
        if name in visited:
            raise DescriptionError(self._holder.location, f"'{name}' is attached to itself", "break the circle")
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
            raise DescriptionError(self._where(name), f"the pose depends on itself ({circle})", "break the circle")
        if name in self._inner:
            return self._pose_of_inner(self._inner[name], (*visited, name))
        inner, separator, rest = name.partition(SCOPE)
        if separator and inner in self._inner:
            return self._pose(inner, visited) @ self._inner[inner].frames.pose_in_model(rest)
        node = self._nodes.get(name) or self._joints.get(name)
        if node is None:
            known = ", ".join([MODEL_FRAME, *self._nodes, *self._joints, *self._inner])
            raise DescriptionError(self._holder.location, f"a pose is relative to '{name}'", f"allowed: {known}")
        return self._pose_of_node(node, (*visited, name))

    def _where(self, name: str) -> str:
        node = self._nodes.get(name) or self._joints.get(name) or self._holder
        return node.location

    def _pose_of_node(self, node: XmlNode, visited: tuple[str, ...]) -> Pose:
        pose = node.find("pose")
        base = self._base_of(pose) if pose is not None else ""
        if not base and node.tag == "joint":
            base = node.require("child").text.strip()
            if base not in self._nodes and base not in self._inner:  # the name may have the model's name as a prefix
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
