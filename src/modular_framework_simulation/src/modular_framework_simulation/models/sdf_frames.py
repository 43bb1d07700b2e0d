# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the frames of an SDF model: `<pose relative_to="...">` may chain through links and frames."""

from __future__ import annotations

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.xml_nodes import XmlNode

_MODEL_FRAME = "__model__"


def pose_of(node: XmlNode) -> Pose:
    """Returns the pose an element's text gives: x y z [m] roll pitch yaw [rad].

    Raises:
        DescriptionError: The text is not six numbers.
    """
    x, y, z, roll, pitch, yaw = node.numbers(6)
    return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))


class FrameTree:
    """The named frames of one model.

    Args:
        model: The model's element.
    """

    def __init__(self, model: XmlNode) -> None:
        self._model = model
        self._nodes = {
            child.attributes["name"]: child
            for child in model.children
            if child.tag in ("link", "frame", "joint") and "name" in child.attributes
        }

    def pose_in_model(self, name: str, _visited: tuple[str, ...] = ()) -> Pose:
        """Returns the pose of a link, frame or joint in the model frame.

        Raises:
            DescriptionError: The name is unknown, or the frames are defined by each other in a circle.
        """
        if name in ("", _MODEL_FRAME):
            return Pose()
        node = self._nodes.get(name)
        if node is None:
            known = ", ".join([_MODEL_FRAME, *self._nodes])
            raise DescriptionError(self._model.where, f"a pose is relative to '{name}'", f"allowed: {known}")
        if name in _visited:
            circle = " -> ".join([*_visited, name])
            raise DescriptionError(node.where, f"its pose depends on itself ({circle})", "break the circle")
        visited = (*_visited, name)
        pose_node = node.find("pose")
        default = self._default_base(node)
        if pose_node is None:
            return self.pose_in_model(default, visited)
        base = pose_node.attributes.get("relative_to", pose_node.attributes.get("frame", "")) or default
        return self.pose_in_model(base, visited) @ pose_of(pose_node)

    def joint_pose_in_model(self, joint: XmlNode) -> Pose:
        """Returns the pose of a joint in the model frame; by default that of its child link."""
        return self.pose_in_model(joint.name())

    def _default_base(self, node: XmlNode) -> str:
        if node.tag == "joint":
            return node.require("child").text.strip()
        if node.tag == "frame":
            return node.attributes.get("attached_to", _MODEL_FRAME)
        return _MODEL_FRAME
