# SPDX-License-Identifier: BSD-3-Clause
"""Reads values below a sensor element, and lists the elements that were not read."""

from __future__ import annotations

import math

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.xml_nodes import XmlNode
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise

_NOISE_TYPES = ("none", "gaussian", "gaussian_quantized")
_READ_ELSEWHERE = ("pose",)


class ElementReader:
    """Reads values below an element, by paths such as "scan/horizontal/samples".

    Faults are raised as ValueErrors that begin with the path.

    Args:
        node: The element.
    """

    def __init__(self, node: XmlNode) -> None:
        self.node = node
        self._read: set[int] = {id(child) for child in node.children if child.tag in _READ_ELSEWHERE}

    def find(self, path: str) -> XmlNode | None:
        """Returns the element at a path; None if the element does not exist."""
        node = self.node.find_path(*path.split("/"))
        if node is not None:
            self._read.add(id(node))
        return node

    def skip(self, path: str) -> None:
        """Marks an element and all elements below as read."""
        nodes = [node] if (node := self.node.find_path(*path.split("/"))) is not None else []
        while nodes:
            each = nodes.pop()
            self._read.add(id(each))
            nodes += each.children

    def text(self, path: str, default: str = "") -> str:
        """Returns the text at a path; the default for an empty or missing element."""
        node = self.find(path)
        return (node.text.strip() if node is not None else "") or default

    def number(self, path: str, default: float, minimum: float = -math.inf) -> float:
        """Returns the number at a path.

        Args:
            path: Path of the element.
            default: Value for an empty or missing element.
            minimum: Minimum of the number.

        Raises:
            ValueError: The text is not a finite number, or the number is below the minimum.
        """
        text = self.text(path)
        if not text:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"<{path}>: got '{text}'; expected a number")
        if value < minimum:
            raise ValueError(f"<{path}>: got {value:g}; allowed: {minimum:g} or more")
        return value

    def flag(self, path: str, default: bool) -> bool:
        """Returns the bool at a path.

        Raises:
            ValueError: The text is not true, false, 1 or 0.
        """
        text = self.text(path).lower()
        if text in ("", "true", "1", "false", "0"):
            return text in ("true", "1") if text else default
        raise ValueError(f"<{path}>: got '{text}'; allowed: true, false, 1, 0")

    def vector(self, path: str) -> tuple[float, float, float]:
        """Returns the three numbers at a path; zeros for an empty or missing element.

        Raises:
            ValueError: The text is not three numbers.
        """
        text = self.text(path, "0 0 0")
        try:
            x, y, z = (float(word) for word in text.split())
        except ValueError:
            raise ValueError(f"<{path}>: got '{text}'; expected three numbers") from None
        return (x, y, z)

    def pose(self, path: str) -> Pose:
        """Returns the pose at a path: x y z [m] roll pitch yaw [rad].

        Raises:
            ValueError: The text is not six numbers.
        """
        text = self.text(path, "0 0 0 0 0 0")
        try:
            x, y, z, roll, pitch, yaw = (float(word) for word in text.split())
        except ValueError:
            raise ValueError(f"<{path}>: got '{text}'; expected six numbers: x y z roll pitch yaw") from None
        return Pose.from_xyz_rpy((x, y, z), (roll, pitch, yaw))

    def noise(self, path: str) -> Noise:
        """Returns the <noise> at a path; `NO_NOISE` for a missing element.

        Raises:
            ValueError: The noise type is not supported, or a value is not a number in its range.
        """
        node = self.find(path)
        if node is None:
            return NO_NOISE
        kind = node.attributes.get("type") or self.text(f"{path}/type", "none")
        if kind not in _NOISE_TYPES:
            raise ValueError(f"<{path}>: got type '{kind}'; allowed: {', '.join(_NOISE_TYPES)}")
        self.find(f"{path}/type")
        keys = ("mean", "stddev", "bias_mean", "bias_stddev", "precision")
        values = {key: self.number(f"{path}/{key}", 0.0) for key in keys}
        if kind != "gaussian_quantized":
            values["precision"] = 0.0
        return Noise(**values) if kind != "none" else NO_NOISE

    def unread(self) -> list[str]:
        """Returns the paths of elements that were not read; for an unread branch, only the topmost path."""
        return list(dict.fromkeys(self._unread(self.node, "")))

    def _unread(self, node: XmlNode, path: str) -> list[str]:
        paths = []
        for child in node.children:
            if id(child) in self._read and not child.children:
                continue
            if id(child) in self._read or self._has_read(child):
                paths += self._unread(child, f"{path}{child.tag}/")
            else:
                paths.append(f"{path}{child.tag}")
        return paths

    def _has_read(self, node: XmlNode) -> bool:
        return any(id(child) in self._read or self._has_read(child) for child in node.children)
