# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of policies over all runs of a policy in an episode (component `policy`)."""

from __future__ import annotations

import math

from modular_framework_benchmark.metrics.measurements import EpisodeMeasurements
from modular_framework_ros.reported_figures import (
    POLICY_ACTIONS,
    POLICY_CHUNKS,
    POLICY_CLIPPED,
    POLICY_LATE,
    POLICY_METHOD_TIME,
    POLICY_QUERIES,
    POLICY_QUEUE_TIME,
    POLICY_TRANSPORT_TIME,
    Figure,
)


def _sum(episode: EpisodeMeasurements, figure: Figure) -> float | None:
    values = episode.values_of(figure)
    return math.fsum(values) if values else None


def _mean_per_query(episode: EpisodeMeasurements, duration: Figure) -> float | None:
    """Returns the mean of a duration that the reports sum over their queries [s]; None without an answered query."""
    queries = _sum(episode, POLICY_QUERIES)
    return math.fsum(episode.values_of(duration)) / queries if queries else None


def policy_method_time(episode: EpisodeMeasurements) -> float | None:
    """Mean time of a policy's function per answered query [s]."""
    return _mean_per_query(episode, POLICY_METHOD_TIME)


def policy_queue_time(episode: EpisodeMeasurements) -> float | None:
    """Mean time for which a query waits for other requests to the same policy [s]."""
    return _mean_per_query(episode, POLICY_QUEUE_TIME)


def policy_transport_time(episode: EpisodeMeasurements) -> float | None:
    """Mean time to exchange the messages of a query with a policy [s]."""
    return _mean_per_query(episode, POLICY_TRANSPORT_TIME)


def policy_late_answers(episode: EpisodeMeasurements) -> float | None:
    """Number of answers that took longer than the period of an action in real time, so that the arm waited."""
    return _sum(episode, POLICY_LATE)


def policy_chunks(episode: EpisodeMeasurements) -> float | None:
    """Number of chunks of actions that the arm executed."""
    return _sum(episode, POLICY_CHUNKS)


def policy_actions(episode: EpisodeMeasurements) -> float | None:
    """Number of actions that the arm executed."""
    return _sum(episode, POLICY_ACTIONS)


def policy_clipped_actions(episode: EpisodeMeasurements) -> float | None:
    """Number of executed actions whose targets exceeded a limit and were moved to it (option `clamp`)."""
    return _sum(episode, POLICY_CLIPPED)
