# SPDX-License-Identifier: BSD-3-Clause
"""True state of the world during a task, sampled in the process of the simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROBOT, WORLD = "robot", "world"
"""Names that stand for any robot, and for the world frame."""
TIME_TOLERANCE_S = 1e-6
STATE_SIZE = 13
"""Numbers of a state: position, quaternion, linear and angular velocity."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyTrack:
    """States of a model in the world frame; NaN while the model does not exist.

    Attributes:
        positions: Positions of the model frame, shape (n, 3) [m].
        quaternions: Orientations (xyzw), shape (n, 4).
        linear: Linear velocities, shape (n, 3) [m/s].
        angular: Angular velocities, shape (n, 3) [rad/s].
        joints: Positions of the joints, each of shape (n,) [rad or m], keyed by joint name.
        box: Smallest and largest corner of the collision shapes in the model frame, shape (2, 3) [m]; a point at the
            origin if the model has no shapes.
    """

    positions: Floats
    quaternions: Floats
    linear: Floats
    angular: Floats
    joints: Mapping[str, Floats] = field(default_factory=dict)
    box: Floats = field(default_factory=lambda: np.zeros((2, 3)))

    @property
    def rotations(self) -> Rotation:
        """Returns the orientations; the identity while the model does not exist."""
        is_known = ~np.isnan(self.quaternions[:, :1])
        return Rotation.from_quat(np.where(is_known, self.quaternions, (0.0, 0.0, 0.0, 1.0)))

    @property
    def centres(self) -> Floats:
        """Returns the centres of the bounding box in the world frame, shape (n, 3) [m]."""
        return np.asarray(self.positions + self.rotations.apply(self.box.mean(axis=0)))

    @property
    def corners(self) -> Floats:
        """Returns the corners of the bounding box in the world frame, shape (n, 8, 3) [m]."""
        matrices, corners = self.rotations.as_matrix(), np.array(list(product(*self.box.T)))
        return np.asarray(self.positions[:, None, :] + np.einsum("nij,kj->nki", matrices, corners))

    def points_in_frame(self, points: Floats) -> Floats:
        """Returns points in the model frame.

        Args:
            points: Points in the world frame, shape (n, k, 3) [m].
        """
        offsets = points - self.positions[:, None, :]
        return np.asarray(np.einsum("nji,nkj->nki", self.rotations.as_matrix(), offsets))


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldTrack:
    """States of the world from the start of a task to its check.

    Attributes:
        times_s: Ascending times since the start of the recording, shape (n,) [s]; the first is the start of the task.
        bodies: States of the models, keyed by name.
        contacts: Whether the models of each pair press on each other, shape (n,); pairs without contacts are absent.
        held: Whether a gripper holds each object, shape (n,); objects that are never held are absent.
        robots: Names of the robots.
    """

    times_s: Floats
    bodies: Mapping[str, BodyTrack]
    contacts: Mapping[frozenset[str], Flags] = field(default_factory=dict)
    held: Mapping[str, Flags] = field(default_factory=dict)
    robots: frozenset[str] = frozenset()

    def touches(self, name: str, other: str) -> Flags:
        """Returns whether two models press on each other, shape (n,); `ROBOT` stands for any robot."""
        sides = [self.robots if each == ROBOT else {each} for each in (name, other)]
        contacts = [self.contacts.get(frozenset(pair), self._never) for pair in product(*sides)]
        return np.logical_or.reduce([self._never, *contacts])

    def holds(self, name: str) -> Flags:
        """Returns whether a gripper holds an object, shape (n,)."""
        return self.held.get(name, self._never)

    @property
    def _never(self) -> Flags:
        return np.zeros(len(self.times_s), dtype=bool)


def read_world(record: Mapping[str, Any], origin_s: float, started_s: float, ended_s: float) -> WorldTrack:
    """Returns the states of a record of the simulation, from the last sample before the start of the task.

    Args:
        record: Record of the service `/gazebo/record_world`, decoded from JSON.
        origin_s: Simulated time at the start of the recording [s].
        started_s: Start of the task [s since the start of the recording].
        ended_s: End of the states [s since the start of the recording].
    """
    samples = record["samples"]
    times_s = np.array([sample[0] for sample in samples], dtype=float) - origin_s
    first = max(int(np.searchsorted(times_s, started_s + TIME_TOLERANCE_S, "right")) - 1, 0)
    episode_rows = slice(first, int(np.searchsorted(times_s, ended_s + TIME_TOLERANCE_S, "right")))
    names = sorted({name for sample in samples for name in sample[1]})
    return WorldTrack(
        times_s=times_s[episode_rows],
        bodies={name: _body(samples, name, record["boxes"].get(name), episode_rows) for name in names},
        contacts=_members([[frozenset(pair) for pair in each] for each in _filled_column(samples, 2)], episode_rows),
        held=_members(list(_filled_column(samples, 3)), episode_rows),
        robots=frozenset(record["robots"]),
    )


def _body(samples: Sequence[Any], name: str, box: Any, kept: slice) -> BodyTrack:
    rows = np.full((len(samples), STATE_SIZE), np.nan)
    joints: list[dict[str, float]] = []
    absent: list[Any] = [*[np.nan] * STATE_SIZE, {}]
    state = absent
    for row, sample in enumerate(samples):
        state = sample[1].get(name, state) or absent
        rows[row] = state[:STATE_SIZE]
        joints.append(state[STATE_SIZE])
    joint_names = {joint for each in joints for joint in each}
    positions = {joint: np.array([each.get(joint, np.nan) for each in joints])[kept] for joint in sorted(joint_names)}
    rows = rows[kept]
    return BodyTrack(
        positions=rows[:, :3],
        quaternions=rows[:, 3:7],
        linear=rows[:, 7:10],
        angular=rows[:, 10:],
        joints=positions,
        box=np.zeros((2, 3)) if box is None else np.array(box, dtype=float),
    )


def _filled_column(samples: Sequence[Any], column: int) -> Iterator[Any]:
    """Yields the lists of a column, each repeated while it is unchanged."""
    present: Any = []
    for sample in samples:
        present = present if sample[column] is None else sample[column]
        yield present


def _members(lists: Sequence[Sequence[Any]], rows: slice) -> dict[Any, Flags]:
    """Returns whether each member is in each list, keyed by member."""
    members = {member for each in lists for member in each}
    return {member: np.array([member in each for each in lists], dtype=bool)[rows] for member in members}
