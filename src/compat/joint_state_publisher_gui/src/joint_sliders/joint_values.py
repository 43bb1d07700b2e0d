# SPDX-License-Identifier: BSD-3-Clause
"""Positions, velocities and efforts of all joints: set by hand or by a source, read for publishing."""

from __future__ import annotations

import random
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from joint_sliders.slider_joints import SliderJoints


@dataclass(frozen=True, slots=True)
class JointArrays:
    """What a joint state message holds; an empty array where nothing is known of any joint.

    Attributes:
        names: All joints that move.
        positions: [rad or m].
        velocities: [rad/s or m/s].
        efforts: [N m or N].
    """

    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    efforts: tuple[float, ...]


class JointValues:
    """The state of all joints; it may be used from several threads.

    Args:
        joints: The joints.
        positions: Whether the positions are known from the start; if not, once a joint is moved or a source sends some.
        velocities: Whether the velocities are 0 at the start; if not, they are unknown until a source sends some.
        efforts: The same for the efforts.
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
        """Returns the positions of the joints that are moved by hand [rad or m]."""
        with self._lock:
            return dict(self._positions)

    def set_position(self, name: str, position: float) -> None:
        """Moves a joint [rad or m], at most to its limits.

        Raises:
            KeyError: No joint of this name is moved by hand.
        """
        joint = self._joints.free[name]
        with self._lock:
            self._positions[name] = joint.shown(position)
            self._positions_known = True

    def centre(self) -> None:
        """Moves all joints to their zeros."""
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
        """Moves all joints on by a step [rad or m]: back and forth, and continuous ones round."""
        with self._lock:
            self._positions_known = True
            for name, joint in self._joints.free.items():
                position = self._positions[name] + (step if self._forward[name] else -step)
                if joint.continuous:
                    self._positions[name] = joint.shown(position)
                    continue
                if not joint.lower <= position <= joint.upper:
                    self._forward[name] = not self._forward[name]
                self._positions[name] = joint.shown(position)

    def receive(
        self, names: Sequence[str], positions: Sequence[float], velocities: Sequence[float], efforts: Sequence[float]
    ) -> None:
        """Takes the values that a source has of joints that are moved by hand, as they are; others are passed over.

        Args:
            names: Joints.
            positions: Of these joints [rad or m], or nothing.
            velocities: [rad/s or m/s], or nothing.
            efforts: [N m or N], or nothing.
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
        """Returns the values of all joints; those that follow others are computed."""
        with self._lock:
            return JointArrays(
                self._joints.names,
                self._of_all(self._positions, with_offset=True) if self._positions_known else (),
                self._of_all(self._velocities),
                self._of_all(self._efforts, scaled=False),
            )

    def _of_all(self, values: Mapping[str, float], with_offset: bool = False, scaled: bool = True) -> tuple[float, ...]:
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
