# SPDX-License-Identifier: BSD-3-Clause
"""Figures of a policy, summed over its run."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbf_method.method_client import CallTimes
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

COUNTS = (POLICY_QUERIES, POLICY_LATE, POLICY_CHUNKS, POLICY_ACTIONS, POLICY_CLIPPED)


class PolicyFigures:
    """Adds up the figures of queries and chunks; all counts start at zero.

    Args:
        figures: Receives the sums.
        rate_hz: Number of actions per second.
    """

    def __init__(self, figures: dict[Figure, float], rate_hz: float) -> None:
        self._figures, self._period_s = figures, 1.0 / rate_hz
        figures.update(dict.fromkeys(COUNTS, 0.0))

    def add_query(self, times: CallTimes) -> None:
        """Adds an answered query."""
        is_late = times.method_s + times.queue_s + times.transport_s > self._period_s
        for figure, value in (
            (POLICY_QUERIES, 1.0),
            (POLICY_LATE, float(is_late)),
            (POLICY_METHOD_TIME, times.method_s),
            (POLICY_QUEUE_TIME, times.queue_s),
            (POLICY_TRANSPORT_TIME, times.transport_s),
        ):
            self._add(figure, value)

    def add_chunk(self, clipped: npt.NDArray[np.bool_]) -> None:
        """Adds an executed chunk.

        Args:
            clipped: Whether the target of each executed action was moved to a limit, shape (n,).
        """
        self._add(POLICY_CHUNKS, 1.0)
        self._add(POLICY_ACTIONS, float(len(clipped)))
        self._add(POLICY_CLIPPED, float(clipped.sum()))

    def _add(self, figure: Figure, value: float) -> None:
        self._figures[figure] = self._figures.get(figure, 0.0) + value
