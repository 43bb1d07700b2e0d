# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of the grasp, measured on the object in the world."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from modular_framework_benchmark.metrics.measurements import Array, EpisodeMeasurements, ObjectTrack


def _target(episode: EpisodeMeasurements) -> ObjectTrack | None:
    track = episode.objects.get(episode.target)
    return track if track is not None and len(track.times_s) else None


def lift(episode: EpisodeMeasurements) -> float | None:
    """How much higher the object is at the end than at the start [m]."""
    track = _target(episode)
    return None if track is None else float(track.positions[-1, 2] - track.positions[0, 2])


def slip(episode: EpisodeMeasurements) -> float | None:
    """How far the object moved in the gripper from the first grasp to the end [m]; None if it was not held at the end.

    It is the distance between the object's positions in the frame of the hand at both moments.
    """
    hand, track = episode.hand, _target(episode)
    if hand is None or track is None or not episode.held or episode.grasped_at_s is None or not len(hand.times_s):
        return None
    begin = max(episode.grasped_at_s, float(track.times_s[0]))
    first, last = (_in_hand(track, hand, time_s) for time_s in (begin, float(track.times_s[-1])))
    return float(np.linalg.norm(last - first))


def _in_hand(track: ObjectTrack, hand: ObjectTrack, time_s: float) -> Array:
    """Returns the object's position in the frame of the hand at the samples nearest to a time, shape (3,) [m]."""
    of_object = int(np.abs(track.times_s - time_s).argmin())
    of_hand = int(np.abs(hand.times_s - track.times_s[of_object]).argmin())
    turned = Rotation.from_quat(hand.quaternions[of_hand]).inv()
    return np.asarray(turned.apply(track.positions[of_object] - hand.positions[of_hand]))


def grasp_time(episode: EpisodeMeasurements) -> float | None:
    """Simulated time from the start of the recording until the gripper held the object first [s]; None if never."""
    return episode.grasped_at_s


def hold_time(episode: EpisodeMeasurements) -> float | None:
    """How long the object stayed in the gripper while it was shaken [s]; None where it was not shaken."""
    return None if episode.shake is None else episode.shake.held_s
