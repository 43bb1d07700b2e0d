# SPDX-License-Identifier: BSD-3-Clause
"""Simulates experiments whose truth is known: worlds that draw episodes, and the true figures of each world.

A world draws success and values of a number of trials for each method. The truth of a claim or an interval is the
figure that its sentence names, taken from a very large draw of the same world by code of this module alone; a world may
state that no method wins more pairs than another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from modular_framework_benchmark.records.experiment import (
    Direction,
    ExperimentDescription,
    Factor,
    Metric,
    MetricKind,
)
from modular_framework_benchmark.records.perturbation import PERTURBATION, Perturbations
from modular_framework_benchmark.records.results import ExperimentResults

Floats = NDArray[np.float64]
Generator = np.random.Generator
LIMIT_S = 120.0
TRUTH_TRIALS = 200_000
"""Trials of the draw that the truth is taken from: its error is far below the width of any interval."""


@dataclass(frozen=True)
class Draw:
    """The episodes of a number of trials.

    Attributes:
        success: Whether each method succeeded, shape (pairs, methods).
        values: By metric, the value of each episode, shape (pairs, methods); NaN where it has none.
        unit: Number of the independent unit of each pair, shape (pairs,).
        level: Number of the level of the other factor, shape (pairs,).
        broken: Whether each episode broke, shape (pairs, methods).
    """

    success: NDArray[np.bool_]
    values: dict[str, Floats] = field(default_factory=dict)
    unit: NDArray[np.int64] | None = None
    level: NDArray[np.int64] | None = None
    broken: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class World:
    """What draws episodes.

    Attributes:
        draw: Draws a number of pairs.
        metrics: The metrics beside success.
        no_winner: Whether no method wins more pairs than another, in any metric.
        mode: Mode of the experiment; in `planning` a unit is a problem, otherwise a seed.
    """

    draw: Callable[[Generator, int], Draw]
    metrics: tuple[Metric, ...] = ()
    no_winner: bool = True
    mode: str = "task"

    def __hash__(self) -> int:
        return id(self)


def results(world: World, drawn: Draw, **description: object) -> ExperimentResults:
    """Returns the table that the product reads of drawn episodes."""
    pairs, methods = drawn.success.shape
    names = tuple("abcdefghij"[:methods])
    unit = np.arange(pairs) if drawn.unit is None else drawn.unit
    level = np.zeros(pairs, dtype=np.int64) if drawn.level is None else drawn.level
    broken = np.zeros(drawn.success.shape, dtype=bool) if drawn.broken is None else drawn.broken
    success = (drawn.success & ~broken).ravel()
    table: dict[str, object] = {
        "number": np.arange(pairs * methods),
        "trial": np.repeat(np.arange(pairs), methods),
        "seed": np.repeat(np.arange(pairs) if world.mode == "planning" else unit, methods),
        "object": np.repeat(level, methods).astype(str),
        "method": np.tile(names, pairs),
        "success": success,
        "status": np.where(broken.ravel(), "broken", np.where(success, "succeeded", "failed")),
    }
    if world.mode == "planning":
        table["drawn_problem"] = np.repeat(unit, methods).astype(str)
    table |= {name: values.ravel() for name, values in drawn.values.items()}
    levels = tuple(str(each) for each in range(int(level.max()) + 1))
    factors = (Factor("method", names), Factor("object", levels))
    described = ExperimentDescription(
        "simulated", world.mode, text="", digest="", factors=factors, compared="method",
        metrics=world.metrics, time_limit_s=LIMIT_S, **description  # type: ignore[arg-type]
    )  # fmt: skip
    return ExperimentResults(described, pd.DataFrame(table), pd.DataFrame(), pairs * methods)


def perturbed_results(
    generator: Generator, perturbations: Perturbations, rate: float, methods: int, scenes: int
) -> ExperimentResults:
    """Returns an experiment whose perturbations have no effect, with the episodes in the order of the scenes.

    Args:
        generator: Source of the draws.
        perturbations: Axes and levels.
        rate: True success of every method at every level.
        methods: Number of methods.
        scenes: Scenes, which differ in difficulty; each runs at every level.
    """
    labels = tuple(each.label for each in perturbations.levels)
    ease = np.repeat(generator.beta(4 * rate, 4 * (1 - rate), scenes), len(labels))
    drawn = Draw(
        generator.random((len(ease), methods)) < ease[:, None],
        unit=np.repeat(np.arange(scenes), len(labels)),
        level=np.tile(np.arange(len(labels)), scenes),
    )
    found = results(successes(rate, methods), drawn)
    episodes = found.episodes.assign(
        trial=found.episodes["seed"], **{PERTURBATION: [labels[int(each)] for each in found.episodes["object"]]}
    ).drop(columns="object")
    factors = (found.description.factors[0], Factor(PERTURBATION, labels))
    return replace(found, description=replace(found.description, factors=factors), episodes=episodes)


# --- the truth, by code that shares nothing with the product


def scores(world: World, drawn: Draw, metric: Metric | None) -> Floats:
    """Returns what each episode counts in a comparison, higher is better; None is success."""
    success = drawn.success if drawn.broken is None else drawn.success & ~drawn.broken
    if metric is None:
        return success.astype(float)
    sign = 1.0 if metric.better is Direction.HIGHER else -1.0
    if metric.kind is MetricKind.PARTIAL_CREDIT:
        return np.nan_to_num(drawn.values[metric.name])
    failed = ~success & (metric.component == "task" or world.mode != "task" or np.isnan(drawn.values[metric.name]))
    return np.where(failed, -np.inf, sign * drawn.values[metric.name])


@cache
def large_draw(world: World) -> Draw:
    """Returns the draw that the truth of a world is taken from."""
    return world.draw(np.random.default_rng(99), TRUTH_TRIALS)


@cache
def true_wins(world: World, metric: Metric | None, first: int, second: int) -> float:
    """Returns the true win difference of two methods."""
    if world.no_winner:
        return 0.0
    found = scores(world, large_draw(world), metric)
    return float(np.mean((found[:, first] > found[:, second]).astype(float) - (found[:, first] < found[:, second])))


@cache
def true_middle(world: World, metric: Metric | None, method: int) -> tuple[float, float]:
    """Returns the true rate of success, or between which values a true median of the units lies (ties: a range)."""
    drawn = large_draw(world)
    found = scores(world, drawn, metric)[:, method]
    if metric is None:
        return (float(np.mean(found)),) * 2
    sign = 1.0 if metric.better is Direction.HIGHER else -1.0
    if drawn.unit is not None:
        found = pd.Series(found).groupby(drawn.unit).median().to_numpy()
    ends = sorted(sign * np.quantile(found, [0.498, 0.502], method="nearest"))
    return float(ends[0]), float(ends[1])


@cache
def true_mean(world: World, metric: Metric, method: int) -> float:
    """Returns the true mean; failures and values beyond the limit count at the limit."""
    drawn = large_draw(world)
    values = drawn.values[metric.name][:, method].copy()
    if metric.limit is not None:
        values[np.isinf(scores(world, drawn, metric)[:, method])] = metric.limit
        values = np.minimum(values, metric.limit)
    return float(np.nanmean(values))


# --- worlds


def value(name: str, better: Direction = Direction.LOWER, **bounds: float) -> Metric:
    """Returns a metric of planning, in rad."""
    return Metric(name, "planning", MetricKind.VALUE, better, "rad", **bounds)  # type: ignore[arg-type]


TIME = Metric("task_time", "task", MetricKind.TIME, Direction.LOWER, "s", limit=LIMIT_S)
SHARE = value("share", Direction.HIGHER, lowest=0.0, highest=1.0)
PROGRESS = Metric("progress", "task", MetricKind.PARTIAL_CREDIT, Direction.HIGHER, lowest=0.0, highest=1.0)
COUNT = Metric("count", "planning", MetricKind.COUNT, Direction.LOWER)


def shape(generator: Generator, name: str, size: tuple[int, ...]) -> Floats:
    """Returns values of a distribution."""
    match name:
        case "normal":
            return generator.normal(0.0, 1.0, size)
        case "lognormal":
            return generator.lognormal(0.0, 1.0, size)
        case "two-point":
            return np.where(generator.random(size) < 0.05, 20.0, 1.0)
        case "zero-inflated":
            return np.where(generator.random(size) < 0.6, 0.0, generator.lognormal(0.0, 1.0, size))
        case "tied":
            return generator.poisson(1.5, size).astype(float)
        case "rare count":
            return generator.poisson(0.05, size).astype(float)
        case "share":
            return np.where(generator.random(size) < 0.85, 1.0, generator.beta(8.0, 1.5, size))
    raise ValueError(f"no shape {name!r}")


def successes(rate: float, methods: int = 2, advantage: float = 0.0, broken: float = 0.0) -> World:
    """Returns a world of scenes that differ in difficulty; the first method's rate may be higher."""

    def draw(generator: Generator, pairs: int) -> Draw:
        ease = np.full((pairs, 1), rate) if rate in (0.0, 1.0) else generator.beta(4 * rate, 4 * (1 - rate), (pairs, 1))
        better = np.where(np.arange(methods) == 0, advantage, 0.0)
        success = generator.random((pairs, methods)) < np.clip(ease + better, 0.0, 1.0)
        return Draw(success, broken=generator.random((pairs, methods)) < broken)

    return World(draw, no_winner=advantage == 0.0)


def decided(difference: float, share: float) -> World:
    """Returns a world in which two methods differ in a share of the pairs, and by a difference of their rates."""

    def draw(generator: Generator, pairs: int) -> Draw:
        kinds = generator.choice(3, pairs, p=[(share + difference) / 2, (share - difference) / 2, 1 - share])
        return Draw(np.stack([kinds != 1, kinds != 0], axis=1))

    return World(draw, no_winner=False)


def shapes(name: str, metrics: int = 1, methods: int = 2, shift: float = 0.0) -> World:
    """Returns a world of methods that always succeed and have values of one distribution, or a shifted one."""
    kinds = {"rare count": COUNT, "tied": COUNT, "share": SHARE}
    if name in kinds:
        described: tuple[Metric, ...] = (kinds[name],)
    else:
        described = tuple(value(f"value_{number}") for number in range(metrics))

    def draw(generator: Generator, pairs: int) -> Draw:
        better = np.where(np.arange(methods) == 0, -shift, 0.0)
        drawn = {metric.name: shape(generator, name, (pairs, methods)) + better for metric in described}
        return Draw(np.ones((pairs, methods), dtype=bool), drawn)

    return World(draw, described, no_winner=shift == 0.0)


def spreads(metrics: int, equal: str) -> World:
    """Returns a world of two methods with equal medians, or equal means, and different shapes."""
    described = tuple(value(f"value_{number}") for number in range(metrics))

    def draw(generator: Generator, pairs: int) -> Draw:
        drawn = {}
        for metric in described:
            narrow, wide = generator.lognormal(0.0, 0.2, pairs), generator.lognormal(0.0, 1.2, pairs)
            if equal == "mean":
                narrow *= np.exp((1.2**2 - 0.2**2) / 2)
            drawn[metric.name] = np.stack([narrow, wide], axis=1)
        return Draw(np.ones((pairs, 2), dtype=bool), drawn)

    return World(draw, described, no_winner=equal == "median")


def times(rates: tuple[float, ...], centres: tuple[float, ...], spread: float = 0.5, limit: float = LIMIT_S) -> World:
    """Returns a world of times that are censored in failures; scenes are harder for all methods or easier."""
    metric = Metric("task_time", "task", MetricKind.TIME, Direction.LOWER, "s", limit=limit)

    def draw(generator: Generator, pairs: int) -> Draw:
        scene = generator.normal(0.0, 0.3, (pairs, 1))
        success = generator.random((pairs, len(rates))) < np.array(rates)
        drawn = np.array(centres) * np.exp(scene + generator.normal(0.0, spread, (pairs, len(rates))))
        return Draw(success, {"task_time": np.where(success, drawn, np.nan)})

    return World(draw, (metric,), no_winner=len(set(zip(rates, centres, strict=True))) == 1)


def milestones(rates: tuple[float, ...], count: int = 4) -> World:
    """Returns a world of tasks with milestones in order; the rate is that of reaching the next one."""

    def draw(generator: Generator, pairs: int) -> Draw:
        scene = generator.normal(0.0, 0.1, (pairs, 1, 1))
        reached = generator.random((pairs, len(rates), count)) < np.array(rates)[:, None] + scene
        progress = np.cumprod(reached, axis=2).sum(axis=2) / count
        return Draw(progress == 1.0, {"progress": progress})

    return World(draw, (PROGRESS,), no_winner=len(set(rates)) == 1)


def problems(count: int, skewed: bool = False, mode: str = "planning") -> World:
    """Returns a world of problems that repeat, each of them better for one of the two methods by chance."""
    length = value("path_length")

    def draw(generator: Generator, pairs: int) -> Draw:
        units = count if pairs < TRUTH_TRIALS else pairs // 5
        unit = np.arange(pairs) % units
        if skewed:  # a tenth of the problems is much worse for the first, the others a little better
            liking = np.where(generator.random(units) < 0.1, -0.45, 0.05)
        else:
            liking = generator.choice([-0.35, 0.35], units)
        success = generator.random((pairs, 2)) < 0.5 + np.stack([liking[unit], -liking[unit]], axis=1)
        lengths = np.exp(generator.normal(0.0, 0.3, (pairs, 2)) - np.stack([liking[unit], -liking[unit]], axis=1))
        return Draw(success, {"path_length": np.where(success, lengths, np.nan)} if not skewed else {}, unit)

    return World(draw, () if skewed else (length,), True, mode)


def shared_seeds(objects: int) -> World:
    """Returns a world whose seed decides the outcome of each method, whatever the object."""

    def draw(generator: Generator, pairs: int) -> Draw:
        unit = np.arange(pairs) // objects
        of_seed = generator.random((int(unit.max()) + 1, 2)) < 0.8
        return Draw(of_seed[unit], unit=unit, level=np.arange(pairs) % objects)

    return World(draw)


def opposite_levels() -> World:
    """Returns a world of two objects, each better for one of two methods: together neither is better."""

    def draw(generator: Generator, pairs: int) -> Draw:
        level = np.arange(pairs) % 2
        rates = np.where(level[:, None] == np.arange(2), 0.9, 0.5)
        return Draw(generator.random((pairs, 2)) < rates, level=level)

    return World(draw)
