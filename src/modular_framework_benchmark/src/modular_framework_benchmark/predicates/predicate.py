# SPDX-License-Identifier: BSD-3-Clause
"""Predicates: statements about the world that hold or not at each moment of an episode, and their combinations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modular_framework_benchmark.predicates.predicate_keys import model_names, number
from modular_framework_benchmark.predicates.world_track import TIME_TOLERANCE_S, Flags, Floats, WorldTrack
from modular_framework_benchmark.records.episode_settings import Tagged


class Stage(Protocol):
    """What is known of the world: the true state of a simulation, or the answers of an operator."""

    @property
    def times_s(self) -> Floats:
        """Returns the moments at which the world is known, shape (n,) [s since the start of the recording]."""

    def satisfied_flags(self, condition: Condition) -> Flags:
        """Returns whether a condition is satisfied at each moment, without its duration, shape (n,)."""

    def measurement_text(self, condition: Condition) -> str:
        """Returns the last measured value, in contrast to the required value."""


class Predicate(Tagged, ABC):
    """A statement about the world."""

    __slots__ = ()

    @abstractmethod
    def truth_over(self, stage: Stage) -> Flags:
        """Returns whether the predicate holds at each moment of a stage, shape (n,)."""

    @abstractmethod
    def failure_reasons(self, stage: Stage) -> tuple[str, ...]:
        """Returns why the predicate does not hold at the last moment of a stage."""

    @property
    @abstractmethod
    def conditions(self) -> tuple[Condition, ...]:
        """Returns the conditions on which the predicate depends."""

    def unmet_reasons(self, stage: Stage) -> tuple[str, ...]:
        """Returns why the predicate does not hold at the last moment of a stage; empty if it holds."""
        return () if self.truth_over(stage)[-1:].any() else self.failure_reasons(stage)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition(Predicate):
    """A predicate that a stage decides.

    Attributes:
        duration: Time for which the condition must be satisfied without interruption [s].
    """

    duration: float = number(0.0, high=3600.0)

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Returns this condition."""
        return (self,)

    def truth_over(self, stage: Stage) -> Flags:
        """Returns whether the condition has been satisfied for its duration at each moment of a stage, shape (n,)."""
        return sustained_flags(stage.satisfied_flags(self), stage.times_s, self.duration)

    def failure_reasons(self, stage: Stage) -> tuple[str, ...]:
        """Returns what was found at the last moment of a stage."""
        is_short = stage.satisfied_flags(self)[-1:].any()
        return (stage.measurement_text(self) + (f" for less than {self.duration:g} s" if is_short else ""),)

    @property
    def names(self) -> tuple[str, ...]:
        """Returns the names of the models that the condition is about, in the order of its keys."""
        return model_names(self)

    def unknown_name_text(self, world: WorldTrack) -> str:
        """Returns a text that names a model or joint that never existed in the world; "" if all names exist."""
        missing = [name for name in self.names if name not in world.bodies]
        return f"there is no '{missing[0]}' in the world" if missing else ""

    @property
    @abstractmethod
    def statement(self) -> str:
        """Returns a description of the condition that an operator confirms or denies."""

    @abstractmethod
    def satisfied_in(self, world: WorldTrack) -> Flags:
        """Returns whether the condition is satisfied at each moment of the true state, shape (n,)."""

    @abstractmethod
    def measurement_text(self, world: WorldTrack) -> str:
        """Returns the measured value at the last moment of the true state, with the required value."""


def sustained_flags(satisfied: Flags, times_s: Floats, duration_s: float) -> Flags:
    """Returns whether a condition has been satisfied for a duration at each moment, shape (n,).

    Args:
        satisfied: Whether the condition is satisfied at each moment, shape (n,).
        times_s: Ascending moments, shape (n,) [s].
        duration_s: Duration without interruption [s].
    """
    begins = satisfied & ~np.concatenate(([False], satisfied[:-1]))
    since_s = np.maximum.accumulate(np.where(begins, times_s, -np.inf))
    return np.asarray(satisfied & (times_s - since_s >= duration_s - TIME_TOLERANCE_S))


@dataclass(frozen=True, slots=True)
class Combination(Predicate):
    """A predicate that combines others.

    Attributes:
        parts: Combined predicates.
    """

    parts: tuple[Predicate, ...]

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Returns the conditions of all parts."""
        return tuple(condition for part in self.parts for condition in part.conditions)

    def failure_reasons(self, stage: Stage) -> tuple[str, ...]:
        """Returns why parts do not hold at the last moment of a stage."""
        return tuple(text for part in self.parts for text in part.unmet_reasons(stage))


class All(Combination):
    """Holds while all parts hold."""

    __slots__ = ()

    def truth_over(self, stage: Stage) -> Flags:
        """Returns whether all parts hold at each moment of a stage, shape (n,)."""
        return np.logical_and.reduce([part.truth_over(stage) for part in self.parts])


class Any(Combination):
    """Holds while at least one part holds."""

    __slots__ = ()

    def truth_over(self, stage: Stage) -> Flags:
        """Returns whether a part holds at each moment of a stage, shape (n,)."""
        return np.logical_or.reduce([part.truth_over(stage) for part in self.parts])


class InOrder(Combination):
    """Holds from the moment at which the last part holds, if the parts have held in order."""

    __slots__ = ()

    def truth_over(self, stage: Stage) -> Flags:
        """Returns whether the parts have held one after the other at each moment of a stage, shape (n,)."""
        reached = np.ones(len(stage.times_s), dtype=bool)
        for part in self.parts:
            reached = np.logical_or.accumulate(part.truth_over(stage) & reached)
        return reached

    def failure_reasons(self, stage: Stage) -> tuple[str, ...]:
        """Returns the first part that did not hold after the parts before it."""
        first_missed = next(
            n for n in range(len(self.parts)) if not InOrder(self.parts[: n + 1]).truth_over(stage)[-1:].any()
        )
        statements = " and ".join(condition.statement for condition in self.parts[first_missed].conditions)
        return (f"it never happened in the given order that {statements}",)


@dataclass(frozen=True, slots=True)
class Not(Predicate):
    """Holds while its part does not hold.

    Attributes:
        part: Predicate that must not hold.
    """

    part: Predicate

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Returns the conditions of the part."""
        return self.part.conditions

    def truth_over(self, stage: Stage) -> Flags:
        """Returns whether the part does not hold at each moment of a stage, shape (n,)."""
        return ~self.part.truth_over(stage)

    def failure_reasons(self, stage: Stage) -> tuple[str, ...]:
        """Returns the conditions that must not hold."""
        return (f"{' and '.join(each.statement for each in self.conditions)}, which must not hold",)
