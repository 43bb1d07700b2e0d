# SPDX-License-Identifier: BSD-3-Clause
"""Metrics of the grasp generation method, from its reports (component `generation`)."""

from __future__ import annotations

from modular_framework_benchmark.metrics.measurements import ComponentReport, EpisodeMeasurements
from modular_framework_ros.reported_figures import BEST_RANK, CANDIDATES, CHECKED, REACHABLE


def _first(episode: EpisodeMeasurements) -> ComponentReport | None:
    """Returns the first report; later reports concern objects that the task moved."""
    reports = episode.of_component("generation")
    return reports[0] if reports else None


def generation_time(episode: EpisodeMeasurements) -> float | None:
    """Real time from the request for grasps to the answer, measured from outside [s]; None without a grasp or request.

    In the mode `grasps`, the value is the time of the search alone.
    """
    first = _first(episode)
    return episode.generation_s if first is not None and first.succeeded else None


def method_processor_time(episode: EpisodeMeasurements) -> float | None:
    """Processor time of the method's processes, children included, until the end of the task [s].

    In the mode `grasps`, the value is the time of the search alone.
    """
    return episode.method_processor_s


def generation_success(episode: EpisodeMeasurements) -> float | None:
    """Whether the first generation found a grasp: 1 or 0."""
    first = _first(episode)
    return None if first is None else float(first.succeeded)


def candidates(episode: EpisodeMeasurements) -> float | None:
    """Number of grasps found by the first generation before their reachability was checked."""
    first = _first(episode)
    return None if first is None else first.figures.get(CANDIDATES)


def best_rank(episode: EpisodeMeasurements) -> float | None:
    """Rank of the first reachable grasp in the method's order, from 1; None without a reachable grasp."""
    first = _first(episode)
    return None if first is None else first.figures.get(BEST_RANK)


def reachable_share(episode: EpisodeMeasurements) -> float | None:
    """Fraction of the grasps checked in the first generation that are reachable without collision, 0 to 1."""
    first = _first(episode)
    if first is None or not first.figures.get(CHECKED):
        return None
    return first.figures.get(REACHABLE, 0.0) / first.figures[CHECKED]
