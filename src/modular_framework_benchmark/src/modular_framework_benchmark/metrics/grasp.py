# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of the grasp, measured on the object in the world."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from modular_framework_benchmark.metrics.measurements import Array, EpisodeMeasurements, ObjectTrack

LIFTED_OFF_M = 0.005
"""How much higher than at the start of the task an object is that has left its support [m]."""
LOST_M = 0.03
"""How far an object has moved in the hand that is no longer held as it was [m]: more than fingers give way."""


def lift(episode: EpisodeMeasurements) -> float | None:
    """How much higher the object is at the end than at the start of the task [m]."""
    heights = _heights(episode)
    return None if heights is None else float(heights[-1])


def grasp_time(episode: EpisodeMeasurements) -> float | None:
    """Simulated time from the start of the task until the object left its support by 5 mm [s]; None if it never did."""
    lifted_off_s = _lifted_off(episode)
    return None if lifted_off_s is None else lifted_off_s - episode.task_started_s


def slip(episode: EpisodeMeasurements) -> float | None:
    """How far the object moved in the hand since it left its support, at the end [m]; None if it was lost.

    It is the distance between the object's positions in the frame of the hand at both moments.
    """
    lifted_off_s = _lifted_off(episode)
    moved = None if lifted_off_s is None else _moved_in_hand(episode, lifted_off_s)
    if moved is None or not episode.held:
        return None
    end = len(moved[0]) if episode.shake is None else int(np.searchsorted(moved[0], episode.shake.started_s, "right"))
    return float(moved[1][max(end - 1, 0)])


def hold_time(episode: EpisodeMeasurements) -> float | None:
    """How long the object stayed in the hand while it was shaken [s]; None where it was not shaken.

    It is lost when it has moved by 3 cm in the frame of the hand; the time ends with the shake at the latest.
    """
    shake = episode.shake
    moved = None if shake is None else _moved_in_hand(episode, shake.started_s)
    if shake is None or moved is None:
        return None
    lost = moved[0][moved[1] > LOST_M]
    return float(min(lost[0] - shake.started_s if lost.size else shake.duration_s, shake.duration_s))


def _target(episode: EpisodeMeasurements) -> ObjectTrack | None:
    track = episode.objects.get(episode.target)
    return track if track is not None and len(track.times_s) else None


def _heights(episode: EpisodeMeasurements) -> Array | None:
    """Returns how much higher the object was than at the start of the task, at each sample [m]."""
    track = _target(episode)
    if track is None:
        return None
    start = max(int(np.searchsorted(track.times_s, episode.task_started_s, "right")) - 1, 0)
    return np.asarray(track.positions[:, 2] - track.positions[start, 2])


def _lifted_off(episode: EpisodeMeasurements) -> float | None:
    track, heights = _target(episode), _heights(episode)
    if track is None or heights is None:
        return None
    times = track.times_s[(heights > LIFTED_OFF_M) & (track.times_s > episode.task_started_s)]
    return float(times[0]) if times.size else None


def _moved_in_hand(episode: EpisodeMeasurements, since_s: float) -> tuple[Array, Array] | None:
    """Returns times since a moment, and how far the object was from its place in the hand at that moment [m]."""
    hand, track = episode.hand, _target(episode)
    if hand is None or track is None or not len(hand.times_s):
        return None
    chosen = track.times_s >= since_s
    times = track.times_s[chosen]
    if not times.size:
        return None
    nearest = np.minimum(np.searchsorted(hand.times_s, times), len(hand.times_s) - 1)
    turned = Rotation.from_quat(hand.quaternions[nearest]).inv()
    in_hand = turned.apply(track.positions[chosen] - hand.positions[nearest])
    return times, np.asarray(np.linalg.norm(in_hand - in_hand[0], axis=1))
