# SPDX-License-Identifier: BSD-3-Clause
"""Power analysis of a planned experiment: the differences that its episodes can show."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.experiment import ExperimentDescription
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.statistics import sentences
from modular_framework_benchmark.statistics.observations import EpisodeTable, metrics_of, pairs_of_methods
from modular_framework_benchmark.statistics.power import detectable_difference, min_units, pairs_for_rate

DISCORDANCE = 0.3
"""Assumed fraction of discordant pairs in success."""
PRINTED_RATES, PRINTED_WINS = (0.05, 0.1, 0.2), (0.2, 0.4, 0.6)
"""Win differences of success and of other metrics whose sample size is printed."""


def power_text(description: ExperimentDescription, episodes: Sequence[EpisodeSpec]) -> str:
    """Returns the smallest differences shown with 80 % power, and the units that typical differences need.

    Args:
        description: Description of the experiment.
        episodes: Planned episodes.
    """
    results = ExperimentResults(description, _planned_table(description, episodes), pd.DataFrame(), len(episodes))
    table, pairs, others = EpisodeTable(results), len(pairs_of_methods(results)), len(metrics_of(results)) - 1
    error_rate = (1.0 - description.confidence) * (0.5 if others else 1.0)
    nouns = f"{table.unit_noun}s"
    lines = [
        f"  what can be shown with {table.unit_count} {nouns} for each method, in 80 % of experiments "
        f"({sentences.quantity_text(pairs, 'comparison')} of success, {pairs * others} of other metrics; "
        "Holm's correction):"
    ]
    if description.sequential:
        minimum = min_units(error_rate / max(pairs, 1), at_any_time=True)
        lines.append(f"    sequential rule: a difference in success after {minimum} {nouns} at the earliest")
    for name, comparisons, discordance in (
        ("success", pairs, DISCORDANCE),
        ("other metrics", pairs * others, 1.0),
    ):
        if comparisons:
            detectable_text = _line(
                table.unit_count, nouns, error_rate / comparisons, discordance, description.sequential
            )
            lines.append(f"    {name}: {detectable_text}")
    return "\n".join(lines)


def _line(units: int, nouns: str, error_rate: float, discordance: float, at_any_time: bool) -> str:
    """Returns the detectable differences of success, whose pairs are partly discordant, or of other metrics."""
    of_success = discordance < 1.0
    differences = PRINTED_RATES if of_success else PRINTED_WINS
    needed = [
        pairs_for_rate(difference, discordance, error_rate, at_any_time=at_any_time) for difference in differences
    ]
    counts = sentences.enumeration([f"{count:,}" if count else "over a million" for count in needed])
    needed_text = f"{_difference_text(differences, of_success)} need {counts} {nouns}"
    smallest, minimum = (
        detectable_difference(units, error_rate, discordance, at_any_time),
        min_units(error_rate, at_any_time),
    )
    if units < minimum:
        return f"no difference, since at least {minimum} {nouns} would have to be won; {needed_text}"
    shown = "none is likely to be shown" if smallest is None else f"from {_difference_text([smallest], of_success)}"
    return f"{shown}; {needed_text}" + (f", if {100 * discordance:g} % of the pairs differ" if of_success else "")


def _difference_text(differences: Sequence[float], of_success: bool) -> str:
    figures = [100 * difference if of_success else 50 + 50 * difference for difference in differences]
    numbers = sentences.enumeration([f"{figure:.3g}" for figure in figures])
    return f"{numbers} points" if of_success else f"{numbers} % of the pairs won"


def _planned_table(description: ExperimentDescription, episodes: Sequence[EpisodeSpec]) -> pd.DataFrame:
    """Returns the planned episodes in the form of a table of results."""
    names = [factor.name for factor in description.factors]
    rows = [
        {
            "trial": spec.trial, "seed": spec.seed, "success": False, "status": "failed",
            **{name: spec.configuration[name] for name in names},
            **({"drawn_problem": spec.settings.drawn_problem} if spec.settings.drawn_problem else {}),
        }
        for spec in episodes
    ]  # fmt: skip
    return pd.DataFrame(rows)
