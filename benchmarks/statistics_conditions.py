# SPDX-License-Identifier: BSD-3-Clause
"""The conditions of `benchmarks/statistics`: what is simulated, what is counted, and the bar of each count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import simulated_experiments as simulate
from scipy import stats
from simulated_experiments import Draw, Generator, World

from modular_framework_benchmark.records.experiment import Metric
from modular_framework_benchmark.records.perturbation import (
    FACTOR,
    NOMINAL,
    Perturbations,
    PerturbedAxis,
    PerturbedLevel,
)
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.regression import compare_experiments
from modular_framework_benchmark.statistics import power, verdicts
from modular_framework_benchmark.statistics.analysis import compare, summarise, summarise_by_level
from modular_framework_benchmark.statistics.comparison import Comparison, Estimate, Interval, MethodSummary, Verdict
from modular_framework_benchmark.statistics.robustness import Robustness, analyse_robustness
from modular_framework_benchmark.statistics.stopping import AnytimeValid

PARTS = 8
"""Parts that the experiments of a condition are dealt out in."""
BARS = {"claims": 0.05, "coverage": 0.93, "power": 0.78}
HALF_DEVIATION_POWER = 0.8
"""Bar of the power to show normal differences of half a deviation."""
ROW_ERROR = 0.0071
"""Chance that a condition exactly at its bar fails: of 400 experiments at 5 % more than 31."""
SLACK = 0.004
"""True win differences below this are none: the error of the simulated truth."""
_AXES = tuple(PerturbedAxis(f"axis_{index}", FACTOR, 0.0) for index in range(5))
NULL_AXES = Perturbations(
    _AXES,
    (
        PerturbedLevel(NOMINAL, {axis.name: 0.0 for axis in _AXES}),
        *(
            PerturbedLevel(f"{axis.name}={value}", {other.name: value if other is axis else 0.0 for other in _AXES})
            for axis in _AXES
            for value in (1.0, 2.0)
        ),
    ),
    "one_at_a_time",
    0.5,
)
"""Five axes with two levels each; the wanted success is 50 %."""
SHOWN = (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER)

Count = Callable[[Generator], Counter[str]]
"""Runs one experiment; counts `hit` and `no`, or for intervals `KIND/held`, `KIND/missed`, `KIND/none`."""


@dataclass(frozen=True)
class Condition:
    """What is simulated.

    Attributes:
        kind: `claims`, `coverage` or `power`.
        name: What it is called.
        count: Runs one experiment.
        quick: Whether it is part of the quick run.
        own_bar: Bar of this condition; None for the bar of its kind.
    """

    kind: str
    name: str
    count: Count
    quick: bool = False
    own_bar: float | None = None

    @property
    def bar(self) -> float:
        """Returns the bar of the condition."""
        return BARS[self.kind] if self.own_bar is None else self.own_bar


@dataclass(frozen=True)
class Row:
    """What a condition gave.

    Attributes:
        kind: That of the condition.
        name: Its name, and the kind of interval.
        experiments: Experiments, or printed intervals.
        hits: Those that claim, hold or show.
        not_printed: Share of the intervals that were not printed.
        passed: Whether the bar is kept, within the error of the simulation.
    """

    kind: str
    name: str
    experiments: int
    hits: int
    not_printed: float
    passed: bool

    def text(self) -> str:
        """Returns the row as it is printed."""
        share = self.hits / self.experiments if self.experiments else 0.0
        missing = f", {self.not_printed:.0%} not printed" if self.not_printed else ""
        end = "" if self.passed else "  NOT KEPT"
        return f"{self.kind:8} {self.name:70} {self.hits:5} of {self.experiments:5} = {share:6.1%}{missing}{end}"

    def plain(self) -> dict[str, Any]:
        """Returns the row as JSON values."""
        return asdict(self)


def run(chosen: Sequence[Condition], count: int, seed: int, workers: int | None) -> Iterator[Row]:
    """Yields the rows of the conditions.

    Args:
        chosen: The conditions.
        count: Experiments of each.
        seed: Of the simulations.
        workers: Processes; None: as many as cores.
    """
    size = -(-count // PARTS)
    places = {id(each): number for number, each in enumerate(CONDITIONS)}
    with ProcessPoolExecutor(workers, initializer=_leave_out_plans) as pool:
        waiting = []
        for each in chosen:
            number = places[id(each)]
            seeds = np.random.SeedSequence([seed, number]).spawn(PARTS)
            waiting.append((each, [pool.submit(_part, number, part, size) for part in seeds]))
        for each, parts in waiting:
            yield from rows_of(each, sum((part.result() for part in parts), Counter()))


def _part(number: int, seed: np.random.SeedSequence, size: int) -> Counter[str]:
    generator = np.random.default_rng(seed)
    return sum((CONDITIONS[number].count(generator) for _ in range(size)), Counter())


def _leave_out_plans() -> None:
    """Leaves out the number of pairs to plan next, which only a sentence has and which takes most of the time."""
    verdicts.pairs_for_rate = lambda *_: None  # type: ignore[assignment]


def rows_of(condition: Condition, found: Counter[str]) -> Iterator[Row]:
    """Yields a row for a condition, or one for each kind of its intervals."""
    if condition.kind != "coverage":
        count, hits = found["hit"] + found["no"], found["hit"]
        bar = stats.binom.isf if condition.kind == "claims" else stats.binom.ppf
        edge = bar(ROW_ERROR, count, condition.bar)
        passed = hits <= edge if condition.kind == "claims" else hits >= edge
        yield Row(condition.kind, condition.name, count, hits, 0.0, bool(passed))
        return
    for kind in sorted({name.partition("/")[0] for name in found}):
        held, missed, none = (found[f"{kind}/{what}"] for what in ("held", "missed", "none"))
        printed = held + missed
        passed = not printed or held >= stats.binom.ppf(ROW_ERROR, printed, condition.bar)
        yield Row("coverage", f"{condition.name}: {kind}", printed, held, none / (printed + none), bool(passed))


# --- claims


def false_claims(world: World, comparisons: Sequence[Comparison]) -> bool:
    """Returns whether a comparison claims a win difference that is not there, or has the other sign."""
    metrics: dict[str, Metric | None] = {"success": None} | {each.name: each for each in world.metrics}
    for found in comparisons:
        if found.verdict in SHOWN:
            truth = simulate.true_wins(
                world, metrics[found.metric], *map("abcdefghij".index, (found.first, found.second))
            )
            if (truth if found.verdict is Verdict.FIRST_BETTER else -truth) <= SLACK:
                return True
    return False


def _flag(hit: bool) -> Counter[str]:
    return Counter({"hit" if hit else "no": 1})


def claims(generator: Generator, world: World, pairs: int) -> Counter[str]:
    """Counts an experiment that claims anything false at its planned end."""
    return _flag(false_claims(world, compare(simulate.results(world, world.draw(generator, pairs)))))


def looking(generator: Generator, world: World, pairs: int, step: int) -> Counter[str]:
    """Counts an experiment with a stopping rule that claims anything false at any look."""
    drawn = world.draw(generator, pairs)
    whole = simulate.results(world, drawn, sequential=True)
    looks = range(step, pairs + 1, step)
    return _flag(any(false_claims(world, compare(_first(whole, look, drawn))) for look in looks))


def _first(whole: ExperimentResults, pairs: int, drawn: Draw) -> ExperimentResults:
    return replace(whole, episodes=whole.episodes.iloc[: pairs * drawn.success.shape[1]])


def extending(generator: Generator, world: World, pairs: int, more: int) -> Counter[str]:
    """Counts a fixed experiment that claims anything false in its report, or after it was extended."""
    drawn = world.draw(generator, more)
    whole = simulate.results(world, drawn, extended=True)
    first = _first(whole, pairs, drawn)
    first = replace(first, description=replace(first.description, extended=False), planned=len(first.episodes))
    return _flag(false_claims(world, compare(first)) or false_claims(world, compare(whole)))


def unfinished(generator: Generator, world: World, pairs: int, step: int) -> Counter[str]:
    """Counts a fixed experiment that claims anything false when it is reported again and again while it runs."""
    drawn = world.draw(generator, pairs)
    whole = simulate.results(world, drawn)
    return _flag(any(false_claims(world, compare(_first(whole, look, drawn))) for look in range(step, pairs + 1, step)))


def alike(generator: Generator, world: World, smallest: float, pairs: int) -> Counter[str]:
    """Counts an experiment that stops because methods are alike that are not."""
    drawn = world.draw(generator, pairs)
    whole = simulate.results(world, drawn, sequential=True)
    rule = AnytimeValid(world.metrics[0].name if world.metrics else "success", smallest)
    for look in (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, pairs):
        decision = rule.decide(_first(whole, look, drawn))
        if decision.stop and look < pairs:
            return _flag("differ by less than" in decision.reason)
    return _flag(False)


def regression(generator: Generator, world: World, pairs: int, same_seeds: bool) -> Counter[str]:
    """Counts two runs of the same code of which one is said to be better."""
    before, after = (simulate.results(world, world.draw(generator, pairs)) for _ in range(2))
    if not same_seeds:
        after = replace(after, episodes=after.episodes.assign(seed=after.episodes["seed"] + 10_000))
    changes = compare_experiments(before, after).changes
    return _flag(any(each.comparison.verdict in SHOWN for each in changes))


def robustness(generator: Generator, methods: int, scenes: int, step: int) -> Counter[str]:
    """Counts a simulated experiment without effects whose reports claim a fall, or success below the true rate.

    The true success of every method at every level is the wanted success. The report of an experiment with a fixed
    number of scenes is repeated while the experiment runs.

    Args:
        generator: Source of the draws.
        methods: Number of methods.
        scenes: Scenes of the experiment.
        step: Scenes between reports; equal to `scenes` for a single report at the end.
    """
    whole = simulate.perturbed_results(generator, NULL_AXES, NULL_AXES.wanted_success, methods, scenes)
    size = len(whole.episodes) // scenes
    looks = (replace(whole, episodes=whole.episodes.iloc[: look * size]) for look in range(step, scenes + 1, step))
    return _flag(any(_claims_an_effect(analyse_robustness(look, NULL_AXES)) for look in looks))


def _claims_an_effect(found: Robustness) -> bool:
    falls = [curve.fall.points.interval for curve in found.curves if curve.fall is not None]
    is_below = any(side.shown_below is not None for curve in found.curves for side in curve.sides)
    return is_below or any(interval is not None and interval.low > 0.0 for interval in falls)


# --- coverage


def coverage(generator: Generator, world: World, pairs: int, sequential: bool = False) -> Counter[str]:
    """Counts the intervals of an experiment that hold the true figure."""
    found: Counter[str] = Counter()
    metrics: dict[str, Metric | None] = {"success": None} | {each.name: each for each in world.metrics}
    results = simulate.results(world, world.draw(generator, pairs), sequential=sequential)
    for each in compare(results):
        truth = simulate.true_wins(world, metrics[each.metric], *map("abcdefghij".index, (each.first, each.second)))
        found[f"win difference/{_held(each.difference, truth, truth)}"] += 1
    for summary in summarise(results):
        found += _summary(world, metrics[summary.metric], summary)
    return found


def _summary(world: World, metric: Metric | None, summary: MethodSummary) -> Counter[str]:
    method = "abcdefghij".index(summary.method)
    found: Counter[str] = Counter()
    if summary.estimate is not None:
        truth = simulate.true_middle(world, metric, method)
        found[f"{summary.estimate.name}/{_held(summary.estimate, *truth)}"] += 1
    if metric is not None and summary.mean is not None:
        mean = simulate.true_mean(world, metric, method)
        found[f"{summary.mean.name}/{_held(summary.mean, mean, mean)}"] += 1
    return found


def _held(estimate: Estimate | None, low: float, high: float) -> str:
    """Returns whether an interval holds a true figure, or meets the range that the truth is in."""
    interval: Interval | None = estimate.interval if estimate else None
    if interval is None:
        return "none"
    return "held" if interval.low <= high + 1e-9 and low - 1e-9 <= interval.high else "missed"


def at_each_look(generator: Generator, world: World, pairs: int, step: int) -> Counter[str]:
    """Counts the sequences of intervals that hold the true win difference at every look."""
    drawn = world.draw(generator, pairs)
    whole = simulate.results(world, drawn, sequential=True)
    truth = simulate.true_wins(world, None, 0, 1)
    looks = [compare(_first(whole, look, drawn))[0].difference for look in range(step, pairs + 1, step)]
    held = all(_held(each, truth, truth) != "missed" for each in looks)
    return Counter({f"win difference at every look/{'held' if held else 'missed'}": 1})


def by_level(generator: Generator, world: World, pairs: int) -> Counter[str]:
    """Counts the rates of success at single levels whose interval holds the true one; no level has a claim."""
    results = simulate.results(world, world.draw(generator, pairs))
    large = simulate.large_draw(world)
    found: Counter[str] = Counter()
    for each in summarise_by_level(results, "object"):
        if each.metric == "success" and large.level is not None:
            rows = large.level == int(each.levels.partition("=")[2])
            truth = float(large.success[rows, "ab".index(each.method)].mean())
            found[f"rate of a level/{_held(each.estimate, truth, truth)}"] += 1
    return found


def mean_differences(generator: Generator, world: World, pairs: int) -> Counter[str]:
    """Counts the intervals of the mean difference of a bounded metric, which are given on request."""
    results = simulate.results(world, world.draw(generator, pairs))
    (metric,) = world.metrics
    found = next(each for each in compare(results, mean_intervals=True) if each.metric == metric.name)
    truth = simulate.true_mean(world, metric, 0) - simulate.true_mean(world, metric, 1)
    return Counter({f"mean difference/{_held(found.mean_difference, truth, truth)}": 1})


# --- power


def shows(generator: Generator, world: World, pairs: int, metric: str = "success") -> Counter[str]:
    """Counts an experiment that shows that the first method is better than the second."""
    found = compare(simulate.results(world, world.draw(generator, pairs)))
    of_pair = next(each for each in found if each.metric == metric and (each.first, each.second) == ("a", "b"))
    return _flag(of_pair.verdict is Verdict.FIRST_BETTER)


def _planned(difference: float, share: float, comparisons: int = 1) -> int:
    pairs = power.pairs_for_rate(difference, share, 0.05 / comparisons)
    assert pairs is not None
    return pairs


def _condition(
    kind: str, name: str, count: Callable[..., Counter[str]], quick: bool = False, **given: Any
) -> Condition:
    return Condition(kind, name, partial(count, **given), quick)


def _claims() -> Iterator[Condition]:
    same = partial(_condition, "claims")
    yield same("success 75 %, 20 pairs", claims, world=simulate.successes(0.75), pairs=20)
    yield same("success 50 %, 200 pairs", claims, world=simulate.successes(0.5), pairs=200)
    yield same("success 75 %, 4 methods, 5 % broken, 60 pairs", claims, True,
               world=simulate.successes(0.75, 4, broken=0.05), pairs=60)  # fmt: skip
    yield same("normal, 5 pairs", claims, world=simulate.shapes("normal"), pairs=5)
    yield same("normal, 20 pairs", claims, True, world=simulate.shapes("normal"), pairs=20)
    yield same("normal, 28 metrics, 200 pairs", claims, world=simulate.shapes("normal", 28), pairs=200)
    yield same("lognormal, 5 metrics, 50 pairs", claims, world=simulate.shapes("lognormal", 5), pairs=50)
    yield same("two-point, 5 metrics, 50 pairs", claims, world=simulate.shapes("two-point", 5), pairs=50)
    yield same("zero-inflated, 5 metrics, 50 pairs", claims, world=simulate.shapes("zero-inflated", 5), pairs=50)
    yield same("tied counts, 3 methods, 20 pairs", claims, world=simulate.shapes("tied", methods=3), pairs=20)
    yield same("robustness, 4 methods, 5 axes without effect, 20 scenes", robustness, methods=4, scenes=20,
               step=20)  # fmt: skip
    yield same(
        "equal medians, other shapes, 15 metrics, 100 pairs", claims, world=simulate.spreads(15, "median"), pairs=100
    )
    yield same(
        "equal means, other shapes, 15 metrics, 100 pairs", claims, world=simulate.spreads(15, "mean"), pairs=100
    )
    yield same("faster, fails more often (15 %, 2 %), 100 pairs", claims, True,
               world=simulate.times((0.85, 0.98), (5.0, 6.0), 0.1), pairs=100)  # fmt: skip
    yield same("censored times, 30 % fail, 3 methods, 50 pairs", claims,
               world=simulate.times((0.7,) * 3, (5.0,) * 3), pairs=50)  # fmt: skip
    yield same("10 methods, 3 metrics, 10 pairs", claims, world=simulate.shapes("normal", 3, 10), pairs=10)
    yield same("20 problems x 5 seeds, interaction", claims, True, world=simulate.problems(20), pairs=100)
    yield same("robustness, 5 axes without effect, reported after every 8 of 40 scenes", robustness, methods=2,
               scenes=40, step=8)  # fmt: skip
    yield same("6 problems x 10 seeds, interaction", claims, world=simulate.problems(6), pairs=60)
    yield same("20 problems x 5 seeds, skewed interaction", claims, world=simulate.problems(20, True), pairs=100)
    yield same("40 seeds shared by 3 objects", claims, world=simulate.shared_seeds(3), pairs=120)
    yield same("2 objects with opposite differences, 100 pairs", claims, world=simulate.opposite_levels(), pairs=100)
    yield same("a look after every 10 of 200 pairs", looking, world=simulate.successes(0.75), pairs=200, step=10)
    yield same("3 methods, 2 metrics, a look after every 15 of 60", looking,
               world=simulate.times((0.7,) * 3, (5.0,) * 3), pairs=60, step=15)  # fmt: skip
    yield same("progress over 4 milestones, a look after every 10 of 100", looking,
               world=simulate.milestones((0.7, 0.7)), pairs=100, step=10)  # fmt: skip
    yield same("reported as alike within 20 points, true difference 28", alike,
               world=simulate.shapes("normal", shift=0.5), smallest=0.2, pairs=128)  # fmt: skip
    yield same("fixed, extended from 50 to 100 pairs", extending, True,
               world=simulate.times((0.7,) * 2, (5.0,) * 2), pairs=50, more=100)  # fmt: skip
    yield same("fixed, extended from 200 to 400 pairs", extending, world=simulate.successes(0.75), pairs=200, more=400)
    yield same("fixed, reported after every 20 of 100 pairs", unfinished, world=simulate.successes(0.75), pairs=100,
               step=20)  # fmt: skip
    yield same("compare, 3 methods, the same seeds, 50 pairs", regression, True,
               world=simulate.times((0.7,) * 3, (5.0,) * 3), pairs=50, same_seeds=True)  # fmt: skip
    yield same("compare, 2 methods, other seeds, 50 pairs", regression, world=simulate.times((0.7,) * 2, (5.0,) * 2),
               pairs=50, same_seeds=False)  # fmt: skip


def _coverage() -> Iterator[Condition]:
    same = partial(_condition, "coverage")
    for rate, pairs in ((0.05, 20), (0.5, 5), (0.75, 10), (1.0, 20)):
        yield same(f"success {100 * rate:g} %, {pairs} pairs", coverage, rate == 0.75, world=simulate.successes(rate),
                   pairs=pairs)  # fmt: skip
    yield same("success 70 points apart, 7 pairs", coverage, world=simulate.decided(0.7, 0.7), pairs=7)
    yield same("success 80 points apart, 20 pairs", coverage, True, world=simulate.decided(0.8, 0.8), pairs=20)
    yield same("success 10 points apart, 100 pairs", coverage, world=simulate.decided(0.1, 0.3), pairs=100)
    for name, pairs in (("normal", 6), ("lognormal", 20), ("two-point", 20), ("zero-inflated", 50), ("tied", 20),
                        ("rare count", 20), ("share", 10), ("share", 50)):  # fmt: skip
        yield same(f"{name}, {pairs} pairs", coverage, name == "lognormal", world=simulate.shapes(name), pairs=pairs)
    yield same("lognormal, half a deviation apart, 200 pairs", coverage, world=simulate.shapes("lognormal", shift=0.5),
               pairs=200)  # fmt: skip
    yield same("times of 6 s, limit 120 s, 3 % fail, 10 pairs", coverage, True,
               world=simulate.times((0.97, 0.9), (6.0, 5.0), 0.8), pairs=10)  # fmt: skip
    yield same("times of 6 s, limit 120 s, 3 % fail, 45 pairs", coverage,
               world=simulate.times((0.97, 0.9), (6.0, 5.0), 0.8), pairs=45)  # fmt: skip
    yield same("20 problems x 5 seeds, interaction", coverage, True, world=simulate.problems(20), pairs=100)
    yield same("8 problems x 10 seeds, interaction", coverage, world=simulate.problems(8), pairs=80)
    yield same("40 seeds shared by 3 objects", coverage, world=simulate.shared_seeds(3), pairs=120)
    yield same("progress over 4 milestones, 40 pairs", coverage, world=simulate.milestones((0.8, 0.7)), pairs=40)
    yield same("2 objects, each by itself, 40 pairs", by_level, world=simulate.opposite_levels(), pairs=40)
    yield same(
        "success, a look after every 10 of 100", at_each_look, world=simulate.decided(0.2, 0.4), pairs=100, step=10
    )
    yield same("mean differences of shares, 20 pairs", mean_differences, world=simulate.shapes("share"), pairs=20)


def _power() -> Iterator[Condition]:
    same = partial(_condition, "power")
    for difference, share in ((0.05, 0.12), (0.12, 0.3), (0.3, 0.5)):
        pairs = _planned(difference, share)
        yield same(f"success, {100 * difference:g} points, {pairs} pairs planned", shows, difference == 0.3,
                   world=simulate.decided(difference, share), pairs=pairs)  # fmt: skip
    won = float(stats.norm.cdf(0.5))
    pairs = _planned(2 * won - 1, 1.0)
    assert pairs <= 55, "half a deviation of normal differences takes at most 55 pairs"
    half = same(f"normal, half a deviation of the differences, {pairs} pairs planned", shows, True,
                world=simulate.shapes("normal", shift=0.5 * 2**0.5), pairs=pairs, metric="value_0")  # fmt: skip
    yield replace(half, own_bar=HALF_DEVIATION_POWER)


CONDITIONS: tuple[Condition, ...] = (*_claims(), *_coverage(), *_power())
