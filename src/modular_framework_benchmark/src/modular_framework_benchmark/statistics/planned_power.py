# SPDX-License-Identifier: BSD-3-Clause
"""Says before an experiment runs which differences its planned episodes can show."""

from __future__ import annotations

import json
from collections.abc import Sequence

import pandas as pd

from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.experiment import ExperimentDescription
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.observations import EpisodeTable, metrics_of, pairs_of_methods
from modular_framework_benchmark.statistics.power import fewest_units, pairs_for_rate, smallest_difference

DECIDED = 0.3
"""Share of the pairs in which the success of two methods is taken to differ, before any episode has run."""
NAMED_RATES, NAMED_WINS = (0.05, 0.1, 0.2), (0.2, 0.4, 0.6)
"""Win differences of success and of other metrics for which the number of units is given."""


def power_text(description: ExperimentDescription, episodes: Sequence[EpisodeSpec]) -> str:
    """Returns the smallest differences that are shown with 80 % power, and how many units some differences need.

    Args:
        description: What is compared.
        episodes: All that are planned.
    """
    results = ExperimentResults(description, _planned(description, episodes), pd.DataFrame(), len(episodes))
    table, pairs, others = EpisodeTable(results), len(pairs_of_methods(results)), len(metrics_of(results)) - 1
    error_rate = (1.0 - description.confidence) * (0.5 if others else 1.0)
    nouns = f"{table.unit_noun}s"
    lines = [
        f"  what can be shown with {table.unit_count} {nouns} for each method, in 80 % of experiments "
        f"({sentences.count(pairs, 'comparison')} of success, {pairs * others} of other metrics; Holm's correction):"
    ]
    if description.sequential:
        fewest = fewest_units(error_rate / max(pairs, 1), at_any_time=True)
        return f"{lines[0]}\n    sequential rule: a difference in success after {fewest} {nouns} at the earliest"
    for name, comparisons, decided in (("success", pairs, DECIDED), ("other metrics", pairs * others, 1.0)):
        if comparisons:
            found = _line(table.unit_count, nouns, error_rate / comparisons, decided)
            lines.append(f"    {name}: {found}")
    return "\n".join(lines)


def _line(units: int, nouns: str, error_rate: float, decided: float) -> str:
    """Returns what is shown of success, whose pairs are decided in part, or of other metrics."""
    of_success = decided < 1.0
    differences = NAMED_RATES if of_success else NAMED_WINS
    needed = [pairs_for_rate(difference, decided, error_rate) for difference in differences]
    counts = sentences.listed([f"{count:,}" if count else "over a million" for count in needed])
    named = f"{_named(differences, of_success)} need {counts} {nouns}"
    smallest, fewest = smallest_difference(units, error_rate, decided), fewest_units(error_rate)
    if units < fewest:
        return f"nothing, whatever happens: at least {fewest} {nouns} would have to be won; {named}"
    shown = "none is likely to be shown" if smallest is None else f"from {_named([smallest], of_success)}"
    return f"{shown}; {named}" + (f", if {100 * decided:g} % of the pairs differ" if of_success else "")


def _named(differences: Sequence[float], of_success: bool) -> str:
    figures = [100 * difference if of_success else 50 + 50 * difference for difference in differences]
    numbers = sentences.listed([f"{figure:.3g}" for figure in figures])
    return f"{numbers} points" if of_success else f"{numbers} % of the pairs won"


def _planned(description: ExperimentDescription, episodes: Sequence[EpisodeSpec]) -> pd.DataFrame:
    """Returns the planned episodes as a table of results would have them."""
    names = [factor.name for factor in description.factors]
    rows = [
        {
            "trial": spec.trial, "seed": spec.seed, "success": False, "status": "failed",
            **{name: spec.configuration[name] for name in names},
            **({"drawn_problem": json.dumps(spec.settings["problem"])} if "problem" in spec.settings else {}),
        }
        for spec in episodes
    ]  # fmt: skip
    return pd.DataFrame(rows)
