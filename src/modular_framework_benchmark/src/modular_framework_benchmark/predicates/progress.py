# SPDX-License-Identifier: BSD-3-Clause
"""Progress of an episode: milestones that are reached one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modular_framework_benchmark.predicates.predicate import Predicate, Stage


@dataclass(frozen=True, slots=True, kw_only=True)
class Milestone:
    """A step towards the goal of a task.

    Attributes:
        name: Name in records and reports.
        predicate: Predicate that holds when the milestone is reached.
        weight: Contribution to the progress, relative to the other weights.
    """

    name: str
    predicate: Predicate
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Progress:
    """Milestones that an episode reached.

    Attributes:
        milestones: All milestones in their order.
        started_s: Start of the task [s since the start of the recording].
        times_s: Moment of each reached milestone, in order [s since the start of the recording].
    """

    milestones: tuple[Milestone, ...]
    started_s: float
    times_s: tuple[float, ...]

    @property
    def fraction(self) -> float:
        """Returns the weight of the reached milestones as a fraction of all weights, from 0 to 1."""
        weights = [milestone.weight for milestone in self.milestones]
        return sum(weights[: len(self.times_s)]) / sum(weights)

    @property
    def first_missed(self) -> str:
        """Returns the name of the first milestone that was not reached; "" if all were reached."""
        missed_milestones = self.milestones[len(self.times_s) :]
        return missed_milestones[0].name if missed_milestones else ""


def progress_of(milestones: Sequence[Milestone], stage: Stage) -> Progress:
    """Returns the progress of an episode: a milestone counts if it holds when or after the previous milestone holds.

    Args:
        milestones: Milestones in their order.
        stage: Knowledge of the world from the start of the task to its check.
    """
    moments: list[float] = []
    first = 0
    for milestone in milestones:
        reached = np.flatnonzero(milestone.predicate.truth_over(stage)[first:])
        if not len(reached):
            break
        first += int(reached[0])
        moments.append(float(stage.times_s[first]))
    return Progress(tuple(milestones), float(stage.times_s[0]), tuple(moments))
