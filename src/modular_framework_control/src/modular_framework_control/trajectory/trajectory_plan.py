# SPDX-License-Identifier: BSD-3-Clause
"""The planned motion of all joints of a trajectory controller.

It is the present motion, and the ones that replace it later.

A trajectory that starts in the future, or moves some of the joints only, leaves the rest of the motion as it is. So the
plan is a sequence of stages with the tracks in force from their beginning on; each joint is in one track of a stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_control.trajectory.joint_trajectory import Array, Track


@dataclass(frozen=True, slots=True)
class _Stage:
    """The tracks in force from `from_s` on, the newest last."""

    from_s: float
    tracks: tuple[Track, ...]


class TrajectoryPlan:
    """The motion of some joints over the time of their controller. One thread changes it; any may sample it.

    Args:
        joints: how many there are.

    Attributes:
        end_s: when the motion of all joints has ended [s].
    """

    __slots__ = ("end_s", "_everything", "_stages")

    def __init__(self, joints: int) -> None:
        self._everything = list(range(joints))
        self._stages: tuple[_Stage, ...] = ()
        self.end_s = 0.0

    @property
    def known_from_s(self) -> float | None:
        """Since when the motion is known [s]; None when there is none yet."""
        stages = self._stages
        return stages[0].from_s if stages else None

    def hold(self, position: Array, time_s: float) -> None:
        """Clears the plan and rests at `position`, shape (joints,), from `time_s` [s] on."""
        self._stages = (_Stage(time_s, (Track.hold(self._everything, position, time_s),)),)
        self.end_s = time_s

    def follow(self, tracks: Sequence[Track], from_s: float) -> None:
        """Makes the joints of `tracks`, no two of which share a joint, follow them from `from_s` [s] on.

        The motion until then, and of the others, stays.
        """
        earlier = tuple(stage for stage in self._stages if stage.from_s < from_s) or self._stages[:1]
        moved = [joint for track in tracks for joint in track.joints]
        others = (old.without(moved) for old in earlier[-1].tracks)
        in_force = (*(other for other in others if other is not None), *tracks)
        self._stages = (*earlier, _Stage(from_s, in_force))
        self.end_s = max(track.end_s for track in in_force)

    def forget_before(self, time_s: float) -> None:
        """Drops the stages that are over at `time_s` [s]."""
        stages = self._stages
        if len(stages) > 1 and time_s >= stages[1].from_s:
            self._stages = tuple(
                stage for i, stage in enumerate(stages) if i + 1 == len(stages) or stages[i + 1].from_s > time_s
            )

    def sample(self, time_s: float) -> Array:
        """Position, velocity and acceleration at `time_s` [s], shape (3, joints)."""
        stage = self._stage_at(time_s)
        if len(stage.tracks) == 1 and stage.tracks[0].joints == self._everything:
            return stage.tracks[0].sample(time_s)
        state = np.zeros((3, len(self._everything)))
        for track in stage.tracks:
            state[:, track.joints] = track.sample(time_s)
        return state

    def elapsed_s(self, time_s: float) -> float:
        """Returns the time since time_from_start 0 of the trajectory in force at `time_s` [s]."""
        track = self._stage_at(time_s).tracks[-1]
        return max(0.0, min(time_s, track.end_s) - track.origin_s)

    def _stage_at(self, time_s: float) -> _Stage:
        stages = self._stages
        stage = stages[0]
        for later in stages[1:]:
            if later.from_s <= time_s:
                stage = later
        return stage
