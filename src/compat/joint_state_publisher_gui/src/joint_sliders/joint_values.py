# SPDX-License-Identifier: BSD-3-Clause
"""Positions, velocities and efforts of all joints, set by the window or a source topic and read by the publisher."""

from __future__ import annotations

import random
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from joint_sliders.slider_joints import SliderJoints


@dataclass(frozen=True, slots=True)
class JointArrays:
    """Arrays of a JointState message; an array without known values is empty.

    Attributes:
        names: Names of all movable joints.
        positions: Joint positions [rad or m].
        velocities: Joint velocities [rad/s or m/s].
        efforts: Joint efforts [Nm or N].
    """

    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    efforts: tuple[float, ...]


class JointValues:
    """Thread-safe state of all joints.

    Args:
        joints: Independent joints and mimic joints.
        positions: Whether the initial positions are published. Otherwise positions are unknown until a joint is moved
            or a source sends positions.
        velocities: Whether the initial velocities are 0. Otherwise they are unknown until a source sends velocities.
        efforts: Whether the initial efforts are 0. Otherwise they are unknown until a source sends efforts.
    """

    def __init__(
        self, joints: SliderJoints, positions: bool = True, velocities: bool = False, efforts: bool = False
    ) -> None:
        self._joints = joints
        self._positions_known = positions
        self._lock = threading.Lock()
        self._forward = dict.fromkeys(joints.free, True)
        self._positions = {name: joint.zero for name, joint in joints.free.items()}
        self._velocities = dict.fromkeys(joints.free, 0.0) if velocities else {}
        self._efforts = dict.fromkeys(joints.free, 0.0) if efforts else {}

    def positions(self) -> dict[str, float]:
        """Returns the positions of the independent joints [rad or m]."""
        with self._lock:
            return dict(self._positions)

    def set_position(self, name: str, position: float) -> None:
        """Sets the position of an independent joint [rad or m], clamped to the joint limits.

        Raises:
            KeyError: The joint is unknown or a mimic joint.
        """
        joint = self._joints.free[name]
        with self._lock:
            self._positions[name] = joint.shown_position(position)
            self._positions_known = True

    def centre(self) -> None:
        """Moves all joints to their zero positions."""
        with self._lock:
            self._positions = {name: joint.zero for name, joint in self._joints.free.items()}
            self._positions_known = True

    def randomise(self, generator: random.Random) -> None:
        """Moves each joint to a random position within its limits."""
        with self._lock:
            for name, joint in self._joints.free.items():
                self._positions[name] = generator.uniform(joint.lower, joint.upper)
            self._positions_known = True

    def sweep(self, step: float) -> None:
        """Moves all joints by a step [rad or m]; a joint with limits reverses at a limit."""
        with self._lock:
            self._positions_known = True
            for name, joint in self._joints.free.items():
                position = self._positions[name] + (step if self._forward[name] else -step)
                if joint.continuous:
                    self._positions[name] = joint.shown_position(position)
                    continue
                if not joint.lower <= position <= joint.upper:
                    self._forward[name] = not self._forward[name]
                self._positions[name] = joint.shown_position(position)

    def receive(
        self, names: Sequence[str], positions: Sequence[float], velocities: Sequence[float], efforts: Sequence[float]
    ) -> None:
        """Adopts the values of independent joints from a source without clamping; ignores all other joints.

        Args:
            names: Joint names.
            positions: Positions of these joints [rad or m]; may be empty.
            velocities: Velocities of these joints [rad/s or m/s]; may be empty.
            efforts: Efforts of these joints [Nm or N]; may be empty.
        """
        with self._lock:
            self._positions_known = self._positions_known or len(positions) > 0
            for known, values in (
                (self._positions, positions),
                (self._velocities, velocities),
                (self._efforts, efforts),
            ):
                known.update(
                    {name: value for name, value in zip(names, values, strict=False) if name in self._joints.free}
                )

    def arrays(self) -> JointArrays:
        """Returns the values of all joints; values of mimic joints are computed from their leaders."""
        with self._lock:
            return JointArrays(
                self._joints.names,
                self._with_mimics(self._positions, with_offset=True) if self._positions_known else (),
                self._with_mimics(self._velocities),
                self._with_mimics(self._efforts, scaled=False),
            )

    def _with_mimics(
        self, values: Mapping[str, float], with_offset: bool = False, scaled: bool = True
    ) -> tuple[float, ...]:
        if not values:
            return ()
        result = []
        for name in self._joints.names:
            mimic = self._joints.following.get(name)
            if mimic is None:
                result.append(values.get(name, 0.0))
            else:
                value = values.get(mimic.leader, 0.0) * (mimic.multiplier if scaled else 1.0)
                result.append(value + (mimic.offset if with_offset else 0.0))
        return tuple(result)
