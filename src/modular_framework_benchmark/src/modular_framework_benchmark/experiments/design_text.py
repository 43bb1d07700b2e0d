# SPDX-License-Identifier: BSD-3-Clause
"""Text that describes the episodes of an experiment, for the dry run."""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_benchmark.experiments.experiment import Experiment
from modular_framework_benchmark.records.episode import EpisodeSpec

MAX_ROWS = 40
"""Number of episodes that are listed."""


def design_text(experiment: Experiment, episodes: Sequence[EpisodeSpec]) -> str:
    """Returns the factors, the metrics and the first episodes of an experiment as text."""
    description = experiment.description
    factors = [
        f"  {factor.name}: {', '.join(factor.levels)}{'  (compared)' if factor.name == description.compared else ''}"
        for factor in description.factors
    ]
    names = [factor.name for factor in description.factors]
    widths = [max(len(name), *(len(spec.configuration[name]) for spec in episodes)) for name in names]
    header = "  ".join(f"{name:<{width}}" for name, width in zip(names, widths, strict=True))
    rows = [
        f"{spec.number:>6}  {spec.trial:>5}  {spec.seed:>10}  "
        + "  ".join(f"{spec.configuration[name]:<{width}}" for name, width in zip(names, widths, strict=True))
        for spec in episodes[:MAX_ROWS]
    ]
    remaining = [f"   ... and {len(episodes) - MAX_ROWS} more"] if len(episodes) > MAX_ROWS else []
    max_hours = len(episodes) * description.time_limit_s / 3600 / experiment.workers
    return "\n".join(
        [
            f"{description.name}: {len(episodes)} episodes = {len(experiment.combinations)} combinations x "
            f"{experiment.trials} trials; mode {description.mode}",
            *factors,
            f"  metrics: {', '.join(metric.name for metric in description.metrics)}",
            *(f"  substitution: {text}" for text in experiment.substitutions),
            f"  at most {max_hours:.1f} h: {description.time_limit_s:g} s an episode, workers: {experiment.workers}",
            f"number  trial        seed  {header}".rstrip(),
            *(row.rstrip() for row in rows),
            *remaining,
        ]
    )
