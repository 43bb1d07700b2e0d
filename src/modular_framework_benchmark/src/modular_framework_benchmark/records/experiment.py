# SPDX-License-Identifier: BSD-3-Clause
"""Describes an experiment: which methods it compares, by which metrics.

It is what a result database keeps of an experiment file, so that statistics and reports need no other source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from modular_framework_ros.reported_figures import Clock, Source


class Direction(Enum):
    """Which values of a metric are better."""

    HIGHER = "higher"
    LOWER = "lower"


class MetricKind(Enum):
    """What the values of a metric are, which decides the statistics that fit."""

    RATE = "rate"  # true or false in each episode, such as success
    VALUE = "value"  # a number, such as a length
    COUNT = "count"  # how many of something, such as attempts
    TIME = "time"  # a duration, censored at a limit when the episode did not finish


@dataclass(frozen=True, slots=True)
class Metric:
    """A figure of an episode.

    Attributes:
        name: Identifier, a column of the result table: `planning_time`.
        component: What it measures: `task`, `generation`, `planning`, `execution`, `grasp` or a user's own.
        kind: What its values are.
        better: Which values are better.
        unit: Unit of the values, such as `s`; "" for none.
        limit: Value at which it is censored [unit]; None: never. An episode that failed counts at the limit.
        description: What it says, in a sentence.
        lowest: Least value that it can have [unit]; None: 0 for counts and times, otherwise none is known.
        highest: Greatest value that it can have [unit]; None: none is known.
        clock: Clock of a duration; None: it is no duration, or the clock is not known.
        source: Who measures it.
    """

    name: str
    component: str
    kind: MetricKind
    better: Direction
    unit: str = ""
    limit: float | None = None
    description: str = ""
    lowest: float | None = None
    highest: float | None = None
    clock: Clock | None = None
    source: Source = Source.MEASURED

    @property
    def bounds(self) -> tuple[float, float]:
        """Returns between which values an episode counts, the limit included [unit]."""
        never_negative = self.kind in (MetricKind.COUNT, MetricKind.TIME)
        low = (0.0 if never_negative else -math.inf) if self.lowest is None else self.lowest
        high = math.inf if self.highest is None else self.highest
        if self.limit is None:
            return low, high
        return (low, min(high, self.limit)) if self.better is Direction.LOWER else (max(low, self.limit), high)


@dataclass(frozen=True, slots=True)
class Factor:
    """What is varied between episodes.

    Attributes:
        name: Identifier, such as `grasp_method`.
        levels: Labels of its values, such as ("top_down", "antipodal").
    """

    name: str
    levels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ExperimentDescription:
    """An experiment as the result database keeps it.

    Attributes:
        name: Name of the experiment.
        mode: `task` (the whole stack in simulation), `planning`, `kinematics` or `grasps`.
        text: The experiment file, verbatim.
        digest: SHA-256 of what decides the episodes, hexadecimal: two files with the same digest run the same episodes.
        factors: What is varied.
        compared: Name of the factor whose levels are the methods that are compared.
        metrics: What is measured.
        time_limit_s: Longest an episode may take [s].
        confidence: Level of the intervals, such as 0.95.
        sequential: Whether a stopping rule looks at the results: its comparisons must then hold at any time.
        source: Path of the experiment file, from whose folder its relative paths count; "" where there is none.
        ran_with: Digests of all that its episodes run with beside their settings, by what it is; empty: not known.
        extended: Whether episodes were added after some had been finished, which is a look at the results.
    """

    name: str
    mode: str
    text: str
    digest: str
    factors: tuple[Factor, ...]
    compared: str
    metrics: tuple[Metric, ...]
    time_limit_s: float
    confidence: float = 0.95
    sequential: bool = False
    source: str = ""
    ran_with: Mapping[str, str] = field(default_factory=dict)
    extended: bool = False

    @property
    def holds_at_any_time(self) -> bool:
        """Returns whether its tests must hold however often the results are looked at."""
        return self.sequential or self.extended
