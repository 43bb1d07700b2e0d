# SPDX-License-Identifier: BSD-3-Clause
"""Stages: the true state of a simulation, and the answers of an operator."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from modular_framework_benchmark.predicates.predicate import Condition, Predicate
from modular_framework_benchmark.predicates.world_track import Flags, Floats, WorldTrack


@dataclass(frozen=True, slots=True)
class SimulatedStage:
    """Stage that knows the true state of a simulated world; implements `Stage`.

    Attributes:
        world: States of the world.
    """

    world: WorldTrack

    @property
    def times_s(self) -> Floats:
        """Returns the moments of the states, shape (n,) [s since the start of the recording]."""
        return self.world.times_s

    def satisfied_flags(self, condition: Condition) -> Flags:
        """Returns whether a condition is satisfied at each moment, shape (n,); never if a model does not exist."""
        if any(name not in self.world.bodies for name in condition.names):
            return np.zeros(len(self.times_s), dtype=bool)
        return condition.satisfied_in(self.world)

    def measurement_text(self, condition: Condition) -> str:
        """Returns the measured value at the last moment."""
        return condition.unknown_name_text(self.world) or condition.measurement_text(self.world)

    def unknown_name_text(self, conditions: Iterable[Condition]) -> str:
        """Returns a text that names a model or joint that never existed in the world; "" if all names exist.

        A condition with an unknown name, or its negation, gives no information about a method.

        Args:
            conditions: Conditions of the success criteria and milestones.
        """
        return next(filter(None, (condition.unknown_name_text(self.world) for condition in conditions)), "")


class OperatorStage:
    """Stage whose conditions an operator judges; implements `Stage`.

    Args:
        ask: Function that asks the operator whether a statement is true.
    """

    def __init__(self, ask: Callable[[str], bool]) -> None:
        self._ask = ask
        self._times_s: list[float] = []
        self._answers: list[dict[Condition, bool]] = []

    def look(self, time_s: float, predicates: Iterable[Predicate]) -> None:
        """Asks the operator about each condition of some predicates at a moment.

        Args:
            time_s: Moment, after all earlier moments [s since the start of the recording].
            predicates: Predicates that will be evaluated.
        """
        conditions = dict.fromkeys(condition for predicate in predicates for condition in predicate.conditions)
        self._answers.append({condition: self._ask(condition.statement) for condition in conditions})
        self._times_s.append(time_s)

    @property
    def times_s(self) -> Floats:
        """Returns the times of the operator's answers, shape (n,) [s since the start of the recording]."""
        return np.array(self._times_s)

    def satisfied_flags(self, condition: Condition) -> Flags:
        """Returns the operator's answers, shape (n,); false if the operator was not asked."""
        return np.array([answers.get(condition, False) for answers in self._answers], dtype=bool)

    def measurement_text(self, condition: Condition) -> str:
        """Returns the statement that the operator denied."""
        return f"the operator denies that {condition.statement}"
