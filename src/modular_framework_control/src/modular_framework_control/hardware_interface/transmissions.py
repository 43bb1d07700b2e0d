# SPDX-License-Identifier: BSD-3-Clause
"""The transmissions of ros_control's transmission_interface: conversions between actuators and joints.

Each transmission maps positions, velocities and efforts from actuators to joints, and back by the inverse formulas.
Ratios are `n`, for actuators `n_a` and for joints `n_j`; a ratio above 1 reduces speed and raises effort, a negative
ratio reverses the direction. Offsets are the joint positions at actuator positions 0.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from modular_framework_ros.node_handle import ParameterError

Values = Sequence[float]
Pair = tuple[float, float]


class TransmissionError(ParameterError):
    """The description of a transmission is invalid."""


class Transmission(ABC):
    """Base class; converts positions [rad|m], velocities [rad/s|m/s] and efforts [Nm|N].

    Attributes:
        size: Number of actuators and of joints.
    """

    size: int

    @abstractmethod
    def joint_positions(self, actuators: Values) -> Values:
        """Returns joint positions from actuator positions."""

    @abstractmethod
    def joint_velocities(self, actuators: Values) -> Values:
        """Returns joint velocities from actuator velocities."""

    @abstractmethod
    def joint_efforts(self, actuators: Values) -> Values:
        """Returns joint efforts from actuator efforts."""

    @abstractmethod
    def actuator_positions(self, joints: Values) -> Values:
        """Returns actuator positions from joint positions."""

    @abstractmethod
    def actuator_velocities(self, joints: Values) -> Values:
        """Returns actuator velocities from joint velocities."""

    @abstractmethod
    def actuator_efforts(self, joints: Values) -> Values:
        """Returns actuator efforts from joint efforts."""


@dataclass(frozen=True)
class SimpleTransmission(Transmission):
    """One actuator moves one joint by gears or a belt: x_a = n (x_j - offset), v_a = n v_j, tau_j = n tau_a.

    Attributes:
        reduction: Ratio n.
        offset: Offset of the joint [rad|m].
    """

    reduction: float
    offset: float = 0.0
    size = 1

    def __post_init__(self) -> None:
        _check((self.reduction,), (self.offset,))

    def joint_positions(self, actuators: Values) -> Values:
        return (actuators[0] / self.reduction + self.offset,)

    def joint_velocities(self, actuators: Values) -> Values:
        return (actuators[0] / self.reduction,)

    def joint_efforts(self, actuators: Values) -> Values:
        return (actuators[0] * self.reduction,)

    def actuator_positions(self, joints: Values) -> Values:
        return ((joints[0] - self.offset) * self.reduction,)

    def actuator_velocities(self, joints: Values) -> Values:
        return (joints[0] * self.reduction,)

    def actuator_efforts(self, joints: Values) -> Values:
        return (joints[0] / self.reduction,)


@dataclass(frozen=True)
class _PairTransmission(Transmission):
    """Two actuators move two joints; positions use the formulas of the velocities, plus the offsets.

    Attributes:
        actuator_reduction: Ratios n_a1, n_a2.
        joint_reduction: Ratios n_j1, n_j2.
        offset: Offsets of the joints [rad|m].
    """

    actuator_reduction: Pair
    joint_reduction: Pair = (1.0, 1.0)
    offset: Pair = (0.0, 0.0)
    size = 2

    def __post_init__(self) -> None:
        _check((*self.actuator_reduction, *self.joint_reduction), self.offset)

    def joint_positions(self, actuators: Values) -> Values:
        first, second = self.joint_velocities(actuators)
        return first + self.offset[0], second + self.offset[1]

    def actuator_positions(self, joints: Values) -> Values:
        return self.actuator_velocities((joints[0] - self.offset[0], joints[1] - self.offset[1]))


@dataclass(frozen=True)
class DifferentialTransmission(_PairTransmission):
    """The sum of both actuators moves the first joint, their difference the second.

    v_a1 = n_a1 (n_j1 v_j1 + n_j2 v_j2), v_a2 = n_a2 (n_j1 v_j1 - n_j2 v_j2);
    tau_j1 = n_j1 (n_a1 tau_a1 + n_a2 tau_a2), tau_j2 = n_j2 (n_a1 tau_a1 - n_a2 tau_a2).
    """

    def joint_velocities(self, actuators: Values) -> Values:
        first, second = (value / n for value, n in zip(actuators, self.actuator_reduction, strict=True))
        return (first + second) / (2.0 * self.joint_reduction[0]), (first - second) / (2.0 * self.joint_reduction[1])

    def joint_efforts(self, actuators: Values) -> Values:
        first, second = (value * n for value, n in zip(actuators, self.actuator_reduction, strict=True))
        return (first + second) * self.joint_reduction[0], (first - second) * self.joint_reduction[1]

    def actuator_velocities(self, joints: Values) -> Values:
        first, second = (value * n for value, n in zip(joints, self.joint_reduction, strict=True))
        return (first + second) * self.actuator_reduction[0], (first - second) * self.actuator_reduction[1]

    def actuator_efforts(self, joints: Values) -> Values:
        first, second = (value / n for value, n in zip(joints, self.joint_reduction, strict=True))
        return (
            (first + second) / (2.0 * self.actuator_reduction[0]),
            (first - second) / (2.0 * self.actuator_reduction[1]),
        )


@dataclass(frozen=True)
class FourBarLinkageTransmission(_PairTransmission):
    """The first actuator alone moves the first joint, both move the second.

    v_a1 = n_j1 n_a1 v_j1, v_a2 = n_a2 (v_j1 + n_j2 v_j2);
    tau_j1 = n_j1 n_a1 tau_a1, tau_j2 = n_j2 (n_a2 tau_a2 - tau_j1).

    These are ros_control's formulas. The efforts do not conserve power (which would need tau_j1 = n_j1 n_a1 tau_a1
    + n_a2 tau_a2), but robot descriptions and gains are tuned for these formulas.
    """

    def joint_velocities(self, actuators: Values) -> Values:
        first = actuators[0] / (self.joint_reduction[0] * self.actuator_reduction[0])
        return first, (actuators[1] / self.actuator_reduction[1] - first) / self.joint_reduction[1]

    def joint_efforts(self, actuators: Values) -> Values:
        first = actuators[0] * self.actuator_reduction[0] * self.joint_reduction[0]
        return first, (actuators[1] * self.actuator_reduction[1] - first) * self.joint_reduction[1]

    def actuator_velocities(self, joints: Values) -> Values:
        return (
            joints[0] * self.joint_reduction[0] * self.actuator_reduction[0],
            (joints[0] + joints[1] * self.joint_reduction[1]) * self.actuator_reduction[1],
        )

    def actuator_efforts(self, joints: Values) -> Values:
        return (
            joints[0] / (self.joint_reduction[0] * self.actuator_reduction[0]),
            (joints[0] + joints[1] / self.joint_reduction[1]) / self.actuator_reduction[1],
        )


def _check(reductions: Values, offsets: Values) -> None:
    if not all(math.isfinite(value) and value != 0.0 for value in reductions):
        raise TransmissionError(f"reductions: got {', '.join(map(str, reductions))}; expected numbers other than 0")
    if not all(map(math.isfinite, offsets)):
        raise TransmissionError(f"offsets: got {', '.join(map(str, offsets))}; expected numbers")
