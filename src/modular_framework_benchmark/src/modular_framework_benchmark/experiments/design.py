# SPDX-License-Identifier: BSD-3-Clause
"""Lays out the episodes of an experiment: which there are, with which scenes and seeds, in which order."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from modular_framework_benchmark.experiments.distributions import generator_of
from modular_framework_benchmark.experiments.experiment import Combination, Experiment
from modular_framework_benchmark.experiments.reading import MAX_SEED
from modular_framework_benchmark.records.episode import EpisodeSpec

PER_TRIAL = ("objects", "problems", "problem")
"""Settings that differ between the trials of a combination; the others decide the stack that runs."""


def lay_out(experiment: Experiment) -> list[EpisodeSpec]:
    """Returns the episodes in the order they are run.

    Trials come one after the other, or by blocks of some. Within a block the episodes that can share a running stack
    are neighbours; groups of these, and the episodes in them, have a random order, made from the experiment's seed.
    """
    episodes: list[EpisodeSpec] = []
    groups = _groups(experiment)
    for first in range(0, experiment.trials, experiment.block):
        trials = range(first, min(first + experiment.block, experiment.trials))
        shuffle = generator_of(experiment.seed, "order", first)
        order = [[(trial, item) for trial in trials for item in group] for group in groups]
        shuffle.shuffle(order)
        for group in order:
            shuffle.shuffle(group)
            for trial, item in group:
                episodes.append(_episode(experiment, item, trial, len(episodes)))
    return episodes


def _groups(experiment: Experiment) -> list[list[Combination]]:
    """Returns the combinations, those together whose episodes can share a stack."""
    groups: dict[str, list[Combination]] = {}
    for item in experiment.combinations:
        groups.setdefault(stack_of(item.settings), []).append(item)
    return list(groups.values())


def stack_of(settings: Mapping[str, Any]) -> str:
    """Returns what decides the running stack of an episode: those with the same text can share one."""
    return _canonical({key: value for key, value in settings.items() if key not in PER_TRIAL})


def _episode(experiment: Experiment, item: Combination, trial: int, number: int) -> EpisodeSpec:
    rest = pair_of(item.configuration, experiment.description.compared)
    return EpisodeSpec(
        number=number,
        configuration=dict(item.configuration),
        trial=trial,
        seed=generator_of(experiment.seed, "episode", rest, trial).randint(1, MAX_SEED),
        settings=_drawn(experiment, item.settings, rest, trial),
    )


def pair_of(configuration: Mapping[str, str], compared: str) -> str:
    """Returns what the episodes of a pair have in common beside the trial: the levels of the factors not compared."""
    return ",".join(f"{name}={configuration[name]}" for name in sorted(configuration) if name != compared)


def _drawn(experiment: Experiment, settings: Mapping[str, Any], rest: str, trial: int) -> dict[str, Any]:
    """Returns the settings of one episode: plain JSON values."""
    drawn = {key: value for key, value in settings.items() if key not in PER_TRIAL}
    if "objects" in settings:
        drawn["objects"] = [
            item.drawn((experiment.seed, rest, trial), index) for index, item in enumerate(settings["objects"])
        ]
    if "problems" in settings:
        drawn["problem"] = settings["problems"][trial % len(settings["problems"])]
    return drawn | {
        "metrics": list(experiment.measures),
        "record": dict(experiment.record),
        "time_limit": experiment.description.time_limit_s,
    }


def digest_of(experiment: Experiment, episodes: Sequence[EpisodeSpec]) -> str:
    """Returns SHA-256 of what decides the episodes, hexadecimal.

    Paths count by their last two parts, so that the digest is the same in every folder; what is in the files counts.
    """
    digest = hashlib.sha256()
    head = {
        "name": experiment.description.name,
        "mode": experiment.description.mode,
        "compare": experiment.description.compared,
        "metrics": [metric.name for metric in experiment.description.metrics],
        "files": dict(experiment.files),
    }
    for part in _parts(head, episodes):
        digest.update(part.encode())
    return digest.hexdigest()


def _parts(head: Mapping[str, Any], episodes: Sequence[EpisodeSpec]) -> Iterator[str]:
    yield _canonical(head)
    for spec in episodes:
        yield _canonical([spec.number, dict(spec.configuration), spec.trial, spec.seed, _portable(spec.settings)])


def _portable(value: Any) -> Any:
    """Returns a value in which absolute paths are their last two parts."""
    match value:
        case str() if value.startswith("/") and "/" in value[1:] and Path(value.rpartition(":")[0] or value).suffix:
            return "/".join(Path(value).parts[-2:])
        case Mapping():
            return {key: _portable(item) for key, item in value.items()}
        case list() | tuple():
            return [_portable(item) for item in value]
        case _:
            return value


def _canonical(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), default=str)
