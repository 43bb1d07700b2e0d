# SPDX-License-Identifier: BSD-3-Clause
"""Small simulated experiments, from results to verdicts: identical methods are told apart in at most 5 % of them.

`benchmarks/statistics` does the same with 2,000 experiments, and for more kinds of them.
"""

from __future__ import annotations

import numpy as np
import pytest
from statistics_results import TIME, outcomes, results_of

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics.analysis import compare
from modular_framework_benchmark.statistics.comparison import Verdict

EXPERIMENTS = 200
MOST = 20  # of 200; with a true share of 5 % more are seen once in 1,000 simulations


def experiment(random: np.random.Generator, methods: str, pairs: int, advantage: float = 0.0) -> ExperimentResults:
    """Returns an experiment with methods that are identical, or of which A fails less often."""
    ease = random.beta(3.0, 1.0, pairs)
    statuses, times = {}, {}
    for method in methods:
        success = random.random(pairs) < ease + (advantage if method == "A" else 0.0) * (1 - ease)
        statuses[method] = outcomes(success)
        times[method] = np.exp(random.normal(2.0 - ease, 0.5))
    return results_of(statuses, (TIME,), {"task_time": times})


def shown(results: ExperimentResults) -> bool:
    return any(each.verdict in (Verdict.FIRST_BETTER, Verdict.SECOND_BETTER) for each in compare(results))


@pytest.mark.parametrize("methods", ["AB", "ABC"])
def test_identical_methods_are_told_apart_in_at_most_5_percent_of_experiments(methods: str) -> None:
    random = np.random.default_rng(5)
    assert sum(shown(experiment(random, methods, 40)) for _ in range(EXPERIMENTS)) <= MOST


def test_a_method_that_fails_much_less_is_told_apart_in_most_experiments() -> None:
    random = np.random.default_rng(5)
    assert sum(shown(experiment(random, "AB", 60, advantage=0.9)) for _ in range(40)) >= 32
