# SPDX-License-Identifier: BSD-3-Clause
"""Stores the planned episodes of an experiment, and checks that a resumed experiment is unchanged."""

from __future__ import annotations

import datetime
import json
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, RowMapping, column, func, insert, select, table, update

from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import as_json
from modular_framework_benchmark.records.experiment import ExperimentDescription
from modular_framework_benchmark.records.level_digests import ABSENT_DIGEST, FILE_PREFIX, combination_key, digests_of
from modular_framework_benchmark.results.columns import (
    add_metric_columns,
    check_names,
    factor_columns,
    insert_row,
    is_numeric,
)
from modular_framework_benchmark.results.errors import DescriptionError, ExperimentChangedError
from modular_framework_benchmark.results.json_records import description_from_json, description_to_json, to_json
from modular_framework_benchmark.results.schema import DESCRIPTIONS, EPISODES, EXPERIMENTS, PLANNER_CONFIGS, RUNS

MAX_LISTED = 6
UNKNOWN_VERSION = "0.0.0"
"""Version in Planner Arena until the first episode reports its version."""


def store_experiment(
    connection: Connection, description: ExperimentDescription, episodes: Sequence[EpisodeSpec]
) -> int:
    """Stores a new experiment with its episodes, or the new episodes of a stored experiment.

    Args:
        connection: Connection to the database.
        description: Description of the experiment.
        episodes: All episodes of the experiment.

    Raises:
        DescriptionError: A name is not a valid column, an episode occurs twice, or settings are not JSON values.
        ExperimentChangedError: The database has a different experiment of this name.
    """
    check_names(description)
    specs = _by_key(description, episodes)
    stored = connection.execute(select(DESCRIPTIONS).where(DESCRIPTIONS.c.name == description.name)).one_or_none()
    if stored is None:
        row = {"name": description.name, "digest": "", "content": "", "added": time.time()}
        number = insert_row(connection, insert(DESCRIPTIONS).values(row))
        new = specs
    else:
        number = stored.id
        old = description_from_json(stored.content)
        _check_extended(connection, number, old, description)
        new = {} if stored.digest == description.digest else _new_episodes(connection, number, old, description, specs)
        analysed = bool(new) or (old.sequential and not description.sequential)
        description = replace(description, extended=old.extended or (analysed and _any_finished(connection, number)))
    content = {"digest": description.digest, "content": description_to_json(description)}
    connection.execute(update(DESCRIPTIONS).where(DESCRIPTIONS.c.id == number).values(content))
    add_metric_columns(connection, description)
    if new:
        _insert_episodes(connection, number, description, new, all_specs=specs)
    return number


def _by_key(description: ExperimentDescription, episodes: Sequence[EpisodeSpec]) -> dict[str, EpisodeSpec]:
    names = {factor.name for factor in description.factors}
    specs: dict[str, EpisodeSpec] = {}
    for spec in sorted(episodes, key=lambda each: each.number):
        if spec.key in specs:
            raise DescriptionError(
                f"experiment {description.name!r}: episode {spec.key!r} is planned twice; remove one"
            )
        if set(spec.configuration) != names:
            raise DescriptionError(
                f"experiment {description.name!r}: episode {spec.key!r} has levels for "
                f"{', '.join(sorted(spec.configuration)) or 'nothing'}; allowed: one for each of "
                f"{', '.join(sorted(names))}"
            )
        specs[spec.key] = spec
    if not specs:
        raise DescriptionError(f"experiment {description.name!r} has no episodes; give it at least one")
    return specs


def _check_extended(
    connection: Connection, number: int, old: ExperimentDescription, new: ExperimentDescription
) -> None:
    """Refuses changed files, packages or parameters of stored combinations of levels."""
    if old.ran_with and new.ran_with:
        keys = _stored_combinations(connection, number)
        changed = [
            name for name in {**old.ran_with, **new.ran_with} if any(_has_changed(old, new, name, key) for key in keys)
        ]
        _refuse_changed(new.name, changed)


def _has_changed(old: ExperimentDescription, new: ExperimentDescription, name: str, combination: str) -> bool:
    """Returns whether a combination lacks digests that it had, or uses content that it did not use."""
    had, has = (digests_of(side.ran_with.get(name, ABSENT_DIGEST), combination) for side in (old, new))
    return not had <= has or bool(has and not had and not name.startswith(FILE_PREFIX))


def _stored_combinations(connection: Connection, number: int) -> list[str]:
    columns = EPISODES.c
    rows = connection.execute(select(columns.configuration).where(columns.descriptionid == number).distinct())
    return [combination_key(json.loads(text)) for text in rows.scalars()]


def check_resumed(stored: ExperimentDescription, ran_with: Mapping[str, str], pending: Sequence[EpisodeSpec]) -> None:
    """Checks that the remaining episodes of an experiment use the files, packages and parameters of the first episodes.

    Args:
        stored: Description of the experiment in the database.
        ran_with: Digests for the remaining episodes, see `run_digests`.
        pending: The remaining episodes.

    Raises:
        ExperimentChangedError: A file, a package or a parameter is different.
    """
    if stored.ran_with:
        keys = {combination_key(spec.configuration) for spec in pending}
        changed = [
            name
            for name, digests in ran_with.items()
            if any(digests_of(digests, key) - digests_of(stored.ran_with.get(name, ABSENT_DIGEST), key) for key in keys)
        ]
        _refuse_changed(stored.name, changed)


def _refuse_changed(experiment: str, changed: list[str]) -> None:
    if changed:
        names = ", ".join(sorted(changed)[:MAX_LISTED]) + (" and others" if len(changed) > MAX_LISTED else "")
        raise ExperimentChangedError(
            f"the database has episodes of {experiment!r} that ran with another state of {names}; allowed: the same "
            "state; restore it, or give the experiment another name, or use another database"
        )


def _new_episodes(
    connection: Connection,
    number: int,
    old: ExperimentDescription,
    new: ExperimentDescription,
    specs: Mapping[str, EpisodeSpec],
) -> dict[str, EpisodeSpec]:
    """Returns the episodes that a larger design adds; it must contain every stored episode unchanged."""
    stored = _stored_episodes(connection, number)
    difference = _difference(old, new) or _first_difference(stored, specs)
    added = {key: spec for key, spec in specs.items() if key not in stored}
    if not difference and not added:
        difference = "the software of its methods differs, while episodes and settings are the same"
    if difference:
        raise ExperimentChangedError(
            f"the database has another experiment called {new.name!r}: {difference}; allowed: the same experiment, or "
            "the same with more repetitions or levels; give the changed one another name, or use another database"
        )
    return added


def _any_finished(connection: Connection, number: int) -> bool:
    of_experiment = select(RUNS.c.id).join_from(RUNS, EPISODES, RUNS.c.id == EPISODES.c.id)
    return connection.execute(of_experiment.where(EPISODES.c.descriptionid == number).limit(1)).first() is not None


def _stored_episodes(connection: Connection, number: int) -> dict[str, RowMapping]:
    columns = EPISODES.c
    rows = connection.execute(
        select(columns.key, columns.seed, columns.settings).where(columns.descriptionid == number)
    )
    return {row["key"]: row for row in rows.mappings()}


def _difference(old: ExperimentDescription, new: ExperimentDescription) -> str:
    for name in ("mode", "compared", "time_limit_s"):
        if getattr(old, name) != getattr(new, name):
            return f"{name} was {getattr(old, name)!r} and is now {getattr(new, name)!r}"
    was, now = ({factor.name for factor in each.factors} for each in (old, new))
    return "" if was == now else f"its factors were {', '.join(sorted(was))} and are now {', '.join(sorted(now))}"


def _first_difference(stored: Mapping[str, RowMapping], specs: Mapping[str, EpisodeSpec]) -> str:
    for key, episode in stored.items():
        spec = specs.get(key)
        if spec is None:
            return f"episode {key!r} is in the database and no longer in the experiment"
        if spec.seed != episode["seed"]:
            return f"the seed of episode {key!r} was {episode['seed']} and is now {spec.seed}"
        if to_json(spec.settings) != episode["settings"]:
            was, now = json.loads(episode["settings"]), json.loads(to_json(spec.settings))
            names = sorted(name for name in was | now if was.get(name) != now.get(name))
            name = names[0]
            return f"{name!r} of episode {key!r} was {was.get(name)!r} and is now {now.get(name)!r}"
    return ""


def _insert_episodes(
    connection: Connection,
    number: int,
    description: ExperimentDescription,
    new: Mapping[str, EpisodeSpec],
    all_specs: Mapping[str, EpisodeSpec],
) -> None:
    """Inserts new episodes in the order of the design; the numbers of an extension follow the stored numbers."""
    last = connection.execute(
        select(func.max(EPISODES.c.number)).where(EPISODES.c.descriptionid == number)
    ).scalar_one_or_none()
    settings = {key: _settings_text(spec) for key, spec in new.items()}
    methods, conditions = _known_rows(connection, number, description)
    _insert_methods(connection, description, all_specs, methods)
    _insert_conditions(connection, description, all_specs, conditions)
    rows = []
    for index, spec in enumerate(new.values()):
        rows.append(
            {
                "descriptionid": number,
                "experimentid": conditions[_condition(description, spec.configuration)],
                "plannerid": methods[spec.configuration[description.compared]],
                "number": spec.number if last is None else last + 1 + index,
                "key": spec.key,
                "trial": spec.trial,
                "seed": spec.seed,
                "configuration": to_json(spec.configuration),
                "settings": settings[spec.key],
            }
        )
    connection.execute(insert(EPISODES), rows)


def _settings_text(spec: EpisodeSpec) -> str:
    try:
        return to_json(spec.settings)
    except TypeError as error:
        raise DescriptionError(f"settings of episode {spec.key!r}: {error}") from error


def _condition(description: ExperimentDescription, configuration: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(configuration[factor.name] for factor in description.factors if factor.name != description.compared)


def _known_rows(
    connection: Connection, number: int, description: ExperimentDescription
) -> tuple[dict[str, int], dict[tuple[str, ...], int]]:
    columns = EPISODES.c
    rows = connection.execute(
        select(columns.configuration, columns.experimentid, columns.plannerid)
        .where(columns.descriptionid == number)
        .distinct()
    )
    methods: dict[str, int] = {}
    conditions: dict[tuple[str, ...], int] = {}
    for text, experiment, planner in rows:
        configuration = json.loads(text)
        methods[configuration[description.compared]] = planner
        conditions[_condition(description, configuration)] = experiment
    return methods, conditions


def _insert_methods(
    connection: Connection,
    description: ExperimentDescription,
    all_specs: Mapping[str, EpisodeSpec],
    methods: dict[str, int],
) -> None:
    """Inserts each method as a planner of Planner Arena, with the settings that all its episodes share."""
    shared: dict[str, dict[str, Any]] = {}
    for spec in all_specs.values():
        settings = as_json(spec.settings)
        known_settings = shared.setdefault(spec.configuration[description.compared], dict(settings))
        for name in [each for each, value in known_settings.items() if settings.get(each) != value]:
            del known_settings[name]
    for level in sorted(set(shared) - set(methods)):
        values = {"name": level, "settings": to_json(shared[level])}
        columns = PLANNER_CONFIGS.c
        same_planner = connection.execute(
            select(columns.id).where(columns.name == level, columns.settings == values["settings"])
        ).scalar_one_or_none()
        methods[level] = same_planner or insert_row(connection, insert(PLANNER_CONFIGS).values(values))


def _insert_conditions(
    connection: Connection,
    description: ExperimentDescription,
    all_specs: Mapping[str, EpisodeSpec],
    conditions: dict[tuple[str, ...], int],
) -> None:
    """Inserts each combination of the other factors' levels as an experiment of Planner Arena with parameters."""
    names = factor_columns(connection, description)
    others = [factor for factor in description.factors if factor.name != description.compared]
    wanted_conditions = {_condition(description, spec.configuration): 0 for spec in all_specs.values()}
    per_method: dict[tuple[str, tuple[str, ...]], int] = {}
    for spec in all_specs.values():
        pair = (spec.configuration[description.compared], _condition(description, spec.configuration))
        per_method[pair] = per_method.get(pair, 0) + 1
    for (_, condition), count in per_method.items():
        wanted_conditions[condition] = max(wanted_conditions[condition], count)
    for condition, count in wanted_conditions.items():
        if condition in conditions:
            connection.execute(
                update(EXPERIMENTS).where(EXPERIMENTS.c.id == conditions[condition]).values(runcount=count)
            )
            continue
        levels = {
            names[factor.name]: float(level) if is_numeric(factor) else level
            for factor, level in zip(others, condition, strict=True)
        }
        conditions[condition] = _insert_condition(connection, description, levels, count)


def _insert_condition(
    connection: Connection, description: ExperimentDescription, levels: Mapping[str, float | str], count: int
) -> int:
    number = insert_row(
        connection,
        insert(EXPERIMENTS).values(
            name=description.name,
            totaltime=0.0,
            timelimit=description.time_limit_s,
            runcount=count,
            version=UNKNOWN_VERSION,
            hostname=platform.node(),
            cpuinfo=_processor(),
            date=datetime.datetime.now(datetime.UTC).replace(tzinfo=None, microsecond=0),
            setup=description.text,
        ),
    )
    if levels:
        experiments = table(EXPERIMENTS.name, column("id"), *map(column, levels))
        connection.execute(update(experiments).where(experiments.c.id == number).values(dict(levels)))
    return number


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{len(names)} x {names[0]}" if names else platform.machine()
