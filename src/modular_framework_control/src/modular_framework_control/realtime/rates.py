# SPDX-License-Identifier: BSD-3-Clause
"""Computes when an action with a fixed rate is due, in the time of the control loop."""

import math


def period_of(rate: float) -> float:
    """Period [s] of a rate [1/s]; a rate of 0 means never."""
    return 1.0 / rate if rate > 0.0 else math.inf


def first_due(period_s: float, time_s: float) -> float:
    """Returns when an action with this period is first due after a start at `time_s` [s]: at once, or never."""
    return time_s if period_s < math.inf else math.inf


def next_due(due_s: float, period_s: float, time_s: float) -> float:
    """Returns when an action with this period is due after it ran at `time_s` [s]; missed ones are not repeated."""
    following_s = due_s + period_s
    return following_s if following_s > time_s else time_s + period_s
