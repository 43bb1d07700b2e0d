# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of the grasp, measured on the object in the world."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from modular_framework_benchmark.metrics.measurements import Array, EpisodeMeasurements, ObjectTrack

LIFTED_OFF_M = 0.005
"""Height above the initial height at which an object has left its support [m]."""
LOST_M = 0.03
"""Displacement in the hand at which an object counts as lost [m]; it exceeds the compliance of fingers."""


def lift(episode: EpisodeMeasurements) -> float | None:
    """Height of the object at the end above its height at the start of the task [m]."""
    heights = _heights(episode)
    return None if heights is None else float(heights[-1])


def grasp_time(episode: EpisodeMeasurements) -> float | None:
    """Simulated time from the start of the task until the object was lifted by 5 mm [s]; None if it never was."""
    lifted_off_s = _lift_off_time(episode)
    return None if lifted_off_s is None else lifted_off_s - episode.task_started_s


def slip(episode: EpisodeMeasurements) -> float | None:
    """Displacement of the object in the hand between lift-off and the end [m]; None if it was lost.

    The displacement is the distance between the object's positions at both moments in the frame of the hand.
    """
    lifted_off_s = _lift_off_time(episode)
    displacement = None if lifted_off_s is None else _displacement_in_hand(episode, lifted_off_s)
    if displacement is None or not episode.held:
        return None
    end = (
        len(displacement[0])
        if episode.shake is None
        else int(np.searchsorted(displacement[0], episode.shake.started_s, "right"))
    )
    return float(displacement[1][max(end - 1, 0)])


def hold_time(episode: EpisodeMeasurements) -> float | None:
    """Duration for which the object stayed in the hand during the shake [s]; None without a shake.

    An object is lost when its displacement in the frame of the hand exceeds 3 cm. The duration is at most the shake's.
    """
    shake = episode.shake
    displacement = None if shake is None else _displacement_in_hand(episode, shake.started_s)
    if shake is None or displacement is None:
        return None
    loss_times_s = displacement[0][displacement[1] > LOST_M]
    return float(min(loss_times_s[0] - shake.started_s if loss_times_s.size else shake.duration_s, shake.duration_s))


def _target(episode: EpisodeMeasurements) -> ObjectTrack | None:
    track = episode.objects.get(episode.target)
    return track if track is not None and len(track.times_s) else None


def _heights(episode: EpisodeMeasurements) -> Array | None:
    """Returns the height of the object above its height at the start of the task, at each sample [m]."""
    track = _target(episode)
    if track is None:
        return None
    start = max(int(np.searchsorted(track.times_s, episode.task_started_s, "right")) - 1, 0)
    return np.asarray(track.positions[:, 2] - track.positions[start, 2])


def _lift_off_time(episode: EpisodeMeasurements) -> float | None:
    track, heights = _target(episode), _heights(episode)
    if track is None or heights is None:
        return None
    times = track.times_s[(heights > LIFTED_OFF_M) & (track.times_s > episode.task_started_s)]
    return float(times[0]) if times.size else None


def _displacement_in_hand(episode: EpisodeMeasurements, since_s: float) -> tuple[Array, Array] | None:
    """Returns times from a given time on, and the object's displacement in the hand since then [m]."""
    hand, track = episode.hand, _target(episode)
    if hand is None or track is None or not len(hand.times_s):
        return None
    chosen = track.times_s >= since_s
    times = track.times_s[chosen]
    if not times.size:
        return None
    nearest = np.minimum(np.searchsorted(hand.times_s, times), len(hand.times_s) - 1)
    rotation = Rotation.from_quat(hand.quaternions[nearest]).inv()
    in_hand = rotation.apply(track.positions[chosen] - hand.positions[nearest])
    return times, np.asarray(np.linalg.norm(in_hand - in_hand[0], axis=1))
