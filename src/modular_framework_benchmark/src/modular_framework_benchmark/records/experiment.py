# SPDX-License-Identifier: BSD-3-Clause
"""Description of an experiment: its factors, methods and metrics.

A result database stores this description of an experiment file, so that statistics and reports need no other source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from enum import Enum

from modular_framework_ros.reported_figures import Clock, Source


class Direction(Enum):
    """Direction in which values of a metric are better."""

    HIGHER = "higher"
    LOWER = "lower"


class MetricKind(Enum):
    """Kind of a metric's values, which determines the statistics."""

    RATE = "rate"  # true or false in each episode, such as success
    VALUE = "value"  # a number, such as a length
    COUNT = "count"  # a number of events, such as attempts
    TIME = "time"  # a duration, censored at a limit if the episode did not finish
    PARTIAL_CREDIT = "partial_credit"  # how far the episode got, from 0 to 1; a failed episode has its own value


@dataclass(frozen=True, slots=True)
class Metric:
    """A figure of an episode.

    Attributes:
        name: Identifier, a column of the result table: `planning_time`.
        component: Measured component: `task`, `generation`, `planning`, `execution`, `grasp` or one of the user.
        kind: Kind of the values.
        better: Direction of better values.
        unit: Unit of the values, such as `s`; "" for none.
        limit: Censoring limit in the metric's unit, at which failed episodes count; None for no limit.
        description: One-sentence description.
        lowest: Smallest possible value in the metric's unit; None for 0 (counts and times) or unknown.
        highest: Largest possible value in the metric's unit; None for unknown.
        clock: Clock of a duration; None if unknown or not a duration.
        source: Origin of the values.
    """

    name: str
    component: str
    kind: MetricKind
    better: Direction
    unit: str = ""
    _: KW_ONLY
    limit: float | None = None
    description: str = ""
    lowest: float | None = None
    highest: float | None = None
    clock: Clock | None = None
    source: Source = Source.MEASURED

    @property
    def depends_on_machine(self) -> bool:
        """Returns whether the values are real or processor times, which the first episode of a stack lengthens."""
        return self.clock in (Clock.WALL, Clock.PROCESSOR)

    @property
    def is_fraction(self) -> bool:
        """Returns whether the values are shown in percent."""
        return self.kind in (MetricKind.RATE, MetricKind.PARTIAL_CREDIT)

    @property
    def bounds(self) -> tuple[float, float]:
        """Returns the smallest and largest value of an episode, including the limit, in the metric's unit."""
        never_negative = self.kind in (MetricKind.COUNT, MetricKind.TIME)
        low = (0.0 if never_negative else -math.inf) if self.lowest is None else self.lowest
        high = math.inf if self.highest is None else self.highest
        if self.kind is MetricKind.PARTIAL_CREDIT:
            return 0.0, 1.0
        if self.limit is None:
            return low, high
        return (low, min(high, self.limit)) if self.better is Direction.LOWER else (max(low, self.limit), high)


@dataclass(frozen=True, slots=True)
class Factor:
    """A factor that varies between episodes.

    Attributes:
        name: Identifier, such as `grasp_method`.
        levels: Labels of the levels, such as ("top_down", "antipodal").
    """

    name: str
    levels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ExperimentDescription:
    """Description of an experiment as stored in the result database.

    Attributes:
        name: Name of the experiment.
        mode: `task` (the whole stack in simulation), `planning`, `kinematics` or `grasps`.
        text: Experiment file, verbatim.
        digest: SHA-256 of everything that determines the episodes, hexadecimal; equal digests mean equal episodes.
        factors: Factors of the experiment.
        compared: Name of the factor whose levels are the compared methods.
        metrics: Measured metrics.
        time_limit_s: Maximum real duration of an episode [s].
        confidence: Confidence level of the intervals, such as 0.95.
        sequential: Whether a stopping rule makes interim analyses, so that comparisons must be anytime-valid.
        source: Path of the experiment file, whose folder is the base of its relative paths; "" if unknown.
        ran_with: Digests of everything that episodes use beside their settings, by description, in the form of
            `level_digests`; empty if unknown.
        extended: Whether episodes were added after others had finished, which is an interim analysis.
    """

    name: str
    mode: str
    _: KW_ONLY
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
        """Returns whether tests must be anytime-valid, because results may be analysed repeatedly."""
        return self.sequential or self.extended
