# SPDX-License-Identifier: BSD-3-Clause
"""A robot of the modes without simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.kinematics.kinematics_settings import KinematicsSettings
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot and its planning parameters.

    Attributes:
        model: Joints, groups, frames, geometry.
        kinematics: Settings of inverse kinematics, by group.
        planning: `robot_description_planning`: limits and default scaling factors.
        pipelines: Parameters of each planning pipeline, by its name.
        urdf: Its description, as text.
    """

    model: RobotModel
    kinematics: Mapping[str, KinematicsSettings] = field(default_factory=dict)
    planning: Mapping[str, Any] = field(default_factory=dict)
    pipelines: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    urdf: str = ""

    def solvers(self) -> KinematicsPool:
        """Returns the inverse kinematics of its groups."""
        return KinematicsPool(self.model, self.kinematics)

    def chain(self, name: str) -> JointGroup:
        """Returns a group that is a chain, as inverse kinematics needs it.

        Raises:
            ModeError: It is none.
            ModelError: There is no such group.
        """
        group = self.model.group(name)
        if not group.is_chain:
            chains = ", ".join(other for other, item in self.model.groups.items() if item.is_chain)
            raise ModeError(f"group '{name}' is no chain, which inverse kinematics needs; allowed: {chains or 'none'}")
        return group
