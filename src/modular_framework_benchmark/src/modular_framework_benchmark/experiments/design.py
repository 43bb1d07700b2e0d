# SPDX-License-Identifier: BSD-3-Clause
"""Plans the episodes of an experiment: their combinations, scenes, seeds and order."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments.distributions import generator_of
from modular_framework_benchmark.experiments.experiment import Combination, Experiment
from modular_framework_benchmark.experiments.reading import MAX_SEED
from modular_framework_benchmark.experiments.scene_objects import sampled_scene
from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import EpisodeSettings, as_json
from modular_framework_benchmark.records.perturbation import PERTURBATION

DRAWN_SETTINGS = ("objects", "problem")
"""Settings that each trial of a combination draws."""
EPISODE_SETTINGS = (*DRAWN_SETTINGS, PERTURBATION)
"""Settings that each episode applies to its world; the other settings determine the running stack."""


def plan_episodes(experiment: Experiment) -> list[EpisodeSpec]:
    """Returns the episodes in the order of their execution.

    Raises ExperimentFault if the objects of a trial do not fit into their ranges.

    The order goes through the trials, or through blocks of trials. Within a block, episodes that can share a running
    stack are adjacent. The order of these groups and of the episodes within them is random, seeded by the experiment.
    """
    episodes: list[EpisodeSpec] = []
    groups = _groups(experiment)
    for first in range(0, experiment.trials, experiment.block):
        trials = range(first, min(first + experiment.block, experiment.trials))
        shuffle = generator_of(experiment.seed, "order", first)
        order = [[(trial, combination) for trial in trials for combination in group] for group in groups]
        shuffle.shuffle(order)
        for group in order:
            shuffle.shuffle(group)
            for trial, combination in group:
                episodes.append(_episode(experiment, combination, trial, len(episodes)))
    return episodes


def _groups(experiment: Experiment) -> list[list[Combination]]:
    """Returns the combinations, grouped by shared stack."""
    groups: dict[str, list[Combination]] = {}
    for combination in experiment.combinations:
        groups.setdefault(stack_of(combination.settings), []).append(combination)
    return list(groups.values())


def stack_of(settings: EpisodeSettings) -> str:
    """Returns the settings that determine an episode's stack as text; episodes with equal texts can share a stack."""
    return _canonical({name: value for name, value in as_json(settings).items() if name not in EPISODE_SETTINGS})


def _episode(experiment: Experiment, combination: Combination, trial: int, number: int) -> EpisodeSpec:
    # All perturbations of a trial share its scene, so that they differ only in what is perturbed.
    pair_key = pair_of(combination.configuration, experiment.description.compared, PERTURBATION)
    return EpisodeSpec(
        number=number,
        configuration=dict(combination.configuration),
        trial=trial,
        seed=generator_of(experiment.seed, "episode", pair_key, trial).randint(1, MAX_SEED),
        settings=_draw_settings(experiment, combination, pair_key, trial),
    )


def pair_of(configuration: Mapping[str, str], *excluded: str) -> str:
    """Returns the levels of the factors that are not excluded, which the episodes with the same scene share."""
    return ",".join(f"{name}={configuration[name]}" for name in sorted(configuration) if name not in excluded)


def _draw_settings(experiment: Experiment, combination: Combination, pair_key: str, trial: int) -> EpisodeSettings:
    """Returns the settings of one episode, with its scene or problem."""
    key, drawn = (experiment.seed, pair_key, trial), dict[str, Any]()
    if combination.objects:
        drawn["objects"] = sampled_scene(combination.objects, key)
    if combination.problems:
        drawn["problem"] = combination.problems[trial % len(combination.problems)]
    return replace(
        combination.settings,
        metrics=experiment.metric_specs,
        record=experiment.record,
        time_limit=experiment.description.time_limit_s,
        **drawn,
    )


def digest_of(experiment: Experiment, episodes: Sequence[EpisodeSpec]) -> str:
    """Returns the SHA-256 digest of everything that determines the episodes, hexadecimal.

    Paths count by their last two parts and files by their content, so that the digest does not depend on the folder.
    """
    digest = hashlib.sha256()
    head = {
        "name": experiment.description.name,
        "mode": experiment.description.mode,
        "compare": experiment.description.compared,
        "metrics": [metric.name for metric in experiment.description.metrics],
        "files": dict(experiment.files),
    }
    for part in _digest_parts(head, episodes):
        digest.update(part.encode())
    return digest.hexdigest()


def _digest_parts(head: Mapping[str, Any], episodes: Sequence[EpisodeSpec]) -> Iterator[str]:
    yield _canonical(head)
    for spec in episodes:
        yield _canonical(
            [spec.number, dict(spec.configuration), spec.trial, spec.seed, _portable(as_json(spec.settings))]
        )


def _portable(value: Any) -> Any:
    """Returns a value whose absolute paths are shortened to their last two parts."""
    match value:
        case str() if value.startswith("/") and "/" in value[1:] and Path(value.rpartition(":")[0] or value).suffix:
            return "/".join(Path(value).parts[-2:])
        case Mapping():
            return {key: _portable(combination) for key, combination in value.items()}
        case list() | tuple():
            return [_portable(combination) for combination in value]
        case _:
            return value


def _canonical(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), default=str)


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
