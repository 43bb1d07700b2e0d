# SPDX-License-Identifier: BSD-3-Clause
"""The mode `kinematics`: inverse kinematics on random poses, without simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_benchmark.experiments.mode import Mode, count, ros_parameters, setting
from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.robot_setting import ModelSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicsSettings(ModelSettings):
    """Settings of an episode of the mode `kinematics`.

    Attributes:
        group: Planning group.
        solver: Solver; "" for the solver in the robot's configuration.
        poses: Number of poses.
        timeout: Time budget of a pose [s].
        parameters: ROS parameters of the solver, keyed by full name.
    """

    group: str = setting(Reading.optional_text, "")
    solver: str = setting(Reading.optional_text, "")
    poses: int = setting(count(), 100)
    timeout: float = setting(Reading.seconds, 0.05)
    parameters: Mapping[str, Any] = setting(ros_parameters, {})

    @property
    def budget_s(self) -> float | None:
        """Returns the time budget of a pose [s]."""
        return self.timeout


KINEMATICS = Mode(
    "kinematics",
    KinematicsSettings,
    "modular_framework_benchmark.modes.ros_kinematics_runner:KinematicsEpisodeRunner",
    "modular_framework_benchmark.modes.ros_setting_checks:check_kinematics",
    frozenset({"kinematics"}),
)
