# SPDX-License-Identifier: BSD-3-Clause
"""Robot of the modes without simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.kinematics.kinematics_settings import KinematicsSettings
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot and its planning parameters.

    Attributes:
        model: Joints, groups, frames and geometry.
        kinematics: Inverse kinematics settings, keyed by group.
        planning: `robot_description_planning`: limits and default scaling factors.
        pipelines: Parameters of the planning pipelines, keyed by name.
        urdf: Robot description (URDF text).
        mesh_folder: Folder with the meshes of packages that are not installed; None for none.
    """

    model: RobotModel
    kinematics: Mapping[str, KinematicsSettings] = field(default_factory=dict)
    planning: Mapping[str, Any] = field(default_factory=dict)
    pipelines: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    urdf: str = ""
    mesh_folder: Path | None = None

    def solvers(self) -> KinematicsPool:
        """Returns the inverse kinematics solvers of the groups."""
        return KinematicsPool(self.model, self.kinematics)

    def chain(self, name: str) -> JointGroup:
        """Returns a group that is a chain, which inverse kinematics requires.

        Raises:
            ModeError: The group is not a chain.
            ModelError: The group does not exist.
        """
        group = self.model.group(name)
        if not group.is_chain:
            chains = ", ".join(other for other, item in self.model.groups.items() if item.is_chain)
            raise ModeError(
                f"group '{name}' is not a chain, as inverse kinematics requires; allowed: {chains or 'none'}"
            )
        return group
