# SPDX-License-Identifier: BSD-3-Clause
"""The planned motion of all joints of a trajectory controller: the current motion and its scheduled replacements.

A trajectory that starts in the future, or moves only some joints, leaves the rest of the motion unchanged. A plan is
therefore a sequence of stages, each with the tracks that are active from its start; each joint is in one track.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_control.trajectory.joint_trajectory import Array, Track


@dataclass(frozen=True, slots=True)
class _Stage:
    """The tracks active from `from_s` on, newest last."""

    from_s: float
    tracks: tuple[Track, ...]


class TrajectoryPlan:
    """The planned motion of a controller's joints; one thread changes the plan, any thread may sample it.

    Args:
        joints: Number of joints.

    Attributes:
        end_s: End time of the motion of all joints.
    """

    __slots__ = ("end_s", "_all_joints", "_stages")

    def __init__(self, joints: int) -> None:
        self._all_joints = list(range(joints))
        self._stages: tuple[_Stage, ...] = ()
        self.end_s = 0.0

    @property
    def stored_from_s(self) -> float | None:
        """Start of the stored motion; None without motion."""
        stages = self._stages
        return stages[0].from_s if stages else None

    def hold(self, position: Array, time_s: float) -> None:
        """Replaces the plan by rest at `position`, shape (joints,), from `time_s` on."""
        self._stages = (_Stage(time_s, (Track.hold(self._all_joints, position, time_s),)),)
        self.end_s = time_s

    def follow(self, tracks: Sequence[Track], from_s: float) -> None:
        """Makes joints follow `tracks` from `from_s` on; earlier motion and all other joints stay unchanged.

        Args:
            tracks: Tracks without common joints.
            from_s: Start time.
        """
        earlier = tuple(stage for stage in self._stages if stage.from_s < from_s) or self._stages[:1]
        moved = [joint for track in tracks for joint in track.joints]
        others = (old.without(moved) for old in earlier[-1].tracks)
        active = (*(other for other in others if other is not None), *tracks)
        self._stages = (*earlier, _Stage(from_s, active))
        self.end_s = max(track.end_s for track in active)

    def forget_before(self, time_s: float) -> None:
        """Drops the stages that have ended at `time_s`."""
        stages = self._stages
        if len(stages) > 1 and time_s >= stages[1].from_s:
            self._stages = tuple(
                stage for i, stage in enumerate(stages) if i + 1 == len(stages) or stages[i + 1].from_s > time_s
            )

    def sample(self, time_s: float) -> Array:
        """Returns position, velocity and acceleration at `time_s`, shape (3, joints)."""
        stage = self._stage_at(time_s)
        if len(stage.tracks) == 1 and stage.tracks[0].joints == self._all_joints:
            return stage.tracks[0].sample(time_s)
        state = np.zeros((3, len(self._all_joints)))
        for track in stage.tracks:
            state[:, track.joints] = track.sample(time_s)
        return state

    def elapsed_s(self, time_s: float) -> float:
        """Returns the time_from_start at `time_s` of the trajectory that is active at this time."""
        track = self._stage_at(time_s).tracks[-1]
        return max(0.0, min(time_s, track.end_s) - track.origin_s)

    def _stage_at(self, time_s: float) -> _Stage:
        stages = self._stages
        stage = stages[0]
        for later in stages[1:]:
            if later.from_s <= time_s:
                stage = later
        return stage
