# SPDX-License-Identifier: BSD-3-Clause
"""Describes the run of an experiment: software, machine, incidents, and commands that repeat the run."""

from __future__ import annotations

import shlex
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from modular_framework_benchmark.experiments.design import DRAWN_SETTINGS
from modular_framework_benchmark.records.episode import EpisodeStatus
from modular_framework_benchmark.records.level_digests import all_digests, combination_key, digests_of
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.records.snapshot_parts import REFERENCE, UNKNOWN_SOURCES, PartKind, kind_of
from modular_framework_benchmark.records.used_software import IMPLEMENTATION
from modular_framework_benchmark.reports.number_text import count_phrase
from modular_framework_benchmark.results.own_table import MODE
from modular_framework_ros.reported_figures import Clock

SnapshotValues = Mapping[str, Sequence[tuple[Any, int]]]
CombinationSnapshots = Mapping[str, SnapshotValues]
"""Snapshots by combination of levels."""

MAX_VALUES = 4
MAX_NAMES = 12
MAX_PARAMETERS = 400
MAX_OTHERS_FRACTION = 0.1
"""Fraction of the machine used by other processes above which real times are doubtful."""
_PER_EPISODE = ("seed", "trial", "number")  # parts that are expected to differ between episodes


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """A value recorded in the snapshots, such as a version.

    Attributes:
        name: Path of keys: `versions.ompl`.
        values: Distinct values with their numbers of episodes, most frequent first.
        others: Number of distinct values that are not listed.
    """

    name: str
    values: tuple[tuple[str, int], ...]
    others: int


def recorded_values(snapshots: SnapshotValues) -> tuple[RecordedValue, ...]:
    """Returns the recorded values of the snapshots.

    Args:
        snapshots: Distinct values of each snapshot part with their numbers of episodes.
    """
    return tuple(_make_recorded_value(name, counts) for name, counts in _count_values(snapshots).items())[
        :MAX_PARAMETERS
    ]


def _make_recorded_value(name: str, counts: Mapping[str, int]) -> RecordedValue:
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return RecordedValue(name, tuple(ordered[:MAX_VALUES]), max(len(ordered) - MAX_VALUES, 0))


def _count_values(snapshots: SnapshotValues) -> dict[str, dict[str, int]]:
    """Returns the number of episodes of each value, by path of keys."""
    counts: dict[str, dict[str, int]] = {}
    for name, values in snapshots.items():
        for value, episodes in values if kind_of(name) is not PartKind.MEASURED else ():
            for path, text in _leaves(value, name):
                _add_counts(counts.setdefault(path, {}), {text: episodes})
    return counts


def _add_counts(counts: dict[str, int], more: Mapping[str, int]) -> None:
    for text, episodes in more.items():
        counts[text] = counts.get(text, 0) + episodes


def _leaves(value: object, name: str) -> Iterator[tuple[str, str]]:
    """Yields the leaf values of nested mappings with key paths, except those that differ by nature."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, f"{name}.{key}")
    elif name.rpartition(".")[2] not in _PER_EPISODE:
        yield name, ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


_UNMEASURED_CAUSES = {
    EpisodeStatus.BROKEN: "the launch died or the measurement failed",
    EpisodeStatus.INVALID: "the world or the judgement was changed from outside, or another planner ran",
}


def warnings_of(
    results: ExperimentResults, snapshots: SnapshotValues, combinations: CombinationSnapshots
) -> tuple[str, ...]:
    """Returns the warnings of a report: unfinished, broken or invalid episodes, faults, inconsistent software.

    Args:
        results: Finished episodes.
        snapshots: Distinct values of each snapshot part, as for `recorded_values`.
        combinations: The same by combination of levels.
    """
    episodes = results.episodes
    warnings = []
    if len(episodes) < results.planned:
        warnings.append(
            f"{len(episodes):,} of {count_phrase(results.planned, 'planned episode')} are finished; "
            "figures cover these."
        )
    for status, cause in _UNMEASURED_CAUSES.items():
        ended = episodes[episodes["status"] == status.value]
        if ended.empty:
            continue
        numbers = ", ".join(str(number) for number in ended["number"].head(12))
        more = f" and {len(ended) - 12:,} more" if len(ended) > 12 else ""
        verb = "is" if len(ended) == 1 else "are"
        warnings.append(
            f"{count_phrase(len(ended), 'episode')} {verb} {status.value}: {cause} (number {numbers}{more}). They "
            "count as failures; the comparisons name the conclusions that depend on them."
        )
    return (*warnings, *_inconsistent(combinations), *_incidents(snapshots), *_load_warning(results, snapshots))


def _inconsistent(combinations: CombinationSnapshots) -> Iterator[str]:
    """Yields decisive values that are not equal in all episodes, or in all episodes with the same levels."""
    software: dict[str, dict[str, int]] = {}
    content: dict[str, dict[str, int]] = {}
    for snapshots in combinations.values():
        for name, counts in _count_values(snapshots).items():
            if kind_of(name) is PartKind.SOFTWARE:
                _add_counts(software.setdefault(name, {}), counts)
            elif kind_of(name) is PartKind.CONTENT and not name.endswith(IMPLEMENTATION):
                known_counts = {text: episodes for text, episodes in counts.items() if text}
                if len(known_counts) > 1:
                    _add_counts(content.setdefault(name, {}), known_counts)
    for episodes, inconsistent_names in (("The episodes", software), ("Episodes with the same levels", content)):
        for name, counts in inconsistent_names.items():
            if len(counts) > 1:
                values = "; ".join(
                    f"{text or 'none'} ({count_phrase(count, 'episode')})"
                    for text, count in _make_recorded_value(name, counts).values
                )
                yield f"{episodes} did not all run with the same {name}: {values}."


def _incidents(snapshots: SnapshotValues) -> Iterator[str]:
    """Yields errors of metrics, methods with unknown sources, and attempts that ended without a record."""
    faults: dict[str, list[tuple[str, int]]] = {}
    for value, episodes in snapshots.get("metric_faults", ()):
        for metric, text in value.items():
            faults.setdefault(metric, []).append((text, episodes))
    for metric, texts in faults.items():
        count = sum(episodes for _, episodes in texts)
        yield f"The metric {metric} raised an error in {count_phrase(count, 'episode')}: {texts[0][0]}."
    for methods, episodes in snapshots.get(UNKNOWN_SOURCES, ()):
        if methods:
            yield (
                f"{count_phrase(episodes, 'episode')} ran with a method or planner whose sources are unknown, so a "
                f"change of it is not noticed: {', '.join(methods)}. Update its package mbf_method; an openpi "
                "server does not report its sources."
            )
    tries = [text for value, episodes in snapshots.get("earlier_tries", ()) for text in value * episodes]
    if tries:
        yield f"{count_phrase(len(tries), 'attempt')} ended without a record, and the episodes ran again: {tries[0]}."


def others_fractions(snapshots: SnapshotValues) -> list[float]:
    """Returns the fraction of the machine that other processes used during each episode that recorded the load."""
    return _fractions(snapshots, "others_share")


def _fractions(snapshots: SnapshotValues, part: str) -> list[float]:
    recorded = snapshots.get(part, ())
    return [float(value) for value, episodes in recorded for _ in range(episodes)]


def _load_warning(results: ExperimentResults, snapshots: SnapshotValues) -> Iterator[str]:
    """Yields the warnings of real times that other processes or other workers of the run lengthened."""
    names = [metric.name for metric in results.description.metrics if metric.clock is Clock.WALL]
    for part, users in (("others_share", "other processes"), ("workers_share", "other workers of the run")):
        fractions = _fractions(snapshots, part)
        busy = sum(fraction > MAX_OTHERS_FRACTION for fraction in fractions)
        if busy and names:
            yield (
                f"{count_phrase(busy, 'episode')} ran beside {users} that used up to {100 * max(fractions):.0f} % "
                f"of the machine, which lengthens real times ({', '.join(names)})."
            )


def differences_of(before: CombinationSnapshots, after: CombinationSnapshots) -> tuple[str, ...]:
    """Returns the differences between the runs of two experiments: versions, planners, methods, machine, settings.

    Episodes with the same levels are compared; without common levels all episodes are compared.

    Args:
        before: Snapshots of the earlier experiment with the settings, by combination of levels.
        after: Snapshots of the later experiment.
    """
    combinations = [name for name in before if name in after]
    values = [{each: _count_values(snapshots) for each, snapshots in side.items()} for side in (before, after)]
    whole = [_pooled_values(side.values()) for side in values]
    differences = []
    for name in dict.fromkeys([*whole[0], *whole[1]]):
        sides = [side.get(name, set()) for side in whole]
        if kind_of(name) is PartKind.SOFTWARE or not combinations or not all(sides):
            if not _are_same(name, sides, pooled=True):
                differences.append(f"{name}{_difference(sides)}")
            continue
        texts: dict[str, list[str]] = {}
        for combination in combinations:
            sides = [set(side[combination].get(name, ())) for side in values]
            if all(sides) and not _are_same(name, sides, pooled=False):
                texts.setdefault(_difference(sides), []).append(combination)
        for text, of_text in texts.items():
            where = "" if len(of_text) == len(combinations) else f" with {'; '.join(of_text[:MAX_VALUES])}"
            differences.append(f"{name}{where}{text}")
    times = [
        [float(value) for snapshots in side.values() for value, _ in snapshots.get(REFERENCE, ())]
        for side in (before, after)
    ]
    if all(times) and any(text.startswith("machine.") for text in differences):
        medians = [statistics.median(side) for side in times]
        differences.append(
            f"the machines: the reference workload takes {medians[0]:.3f} s before and {medians[1]:.3f} s after "
            f"({medians[1] / medians[0]:.2f} times)"
        )
    return tuple(differences)


def _pooled_values(combinations: Iterable[Mapping[str, Iterable[str]]]) -> dict[str, set[str]]:
    """Returns the values of all combinations, by path of keys."""
    pooled: dict[str, set[str]] = {}
    for counts in combinations:
        for name, texts in counts.items():
            pooled.setdefault(name, set()).update(texts)
    return pooled


def _are_same(name: str, sides: Sequence[Set[str]], *, pooled: bool) -> bool:
    """Returns whether two sets of values show no difference between two experiments.

    Args:
        name: Path of keys.
        sides: Values before and after; empty if unknown.
        pooled: Whether the values belong to several combinations of levels.
    """
    before, after = sides
    if name.endswith(IMPLEMENTATION) and not (before and after):
        return True
    if kind_of(name) is PartKind.SETTING and (pooled or name.split(".")[1] in DRAWN_SETTINGS):
        return bool(before & after)  # levels, trials and seeds vary the settings
    if pooled:
        return before == after
    return before <= after or after <= before  # the number of episodes decides which values occur


def _difference(sides: Sequence[Set[str]]) -> str:
    texts = [", ".join(sorted(side)[:MAX_VALUES]) or "nothing" for side in sides]
    return f": before {texts[0]}; after {texts[1]}"


def content_differences(before: ExperimentResults, after: ExperimentResults) -> tuple[str, ...]:
    """Returns the files, packages and parameters whose content differs, by digest, for the same levels.

    Without common levels, contents differ if no digest is common.

    Args:
        before: Finished episodes of the earlier experiment.
        after: Finished episodes of the later experiment.
    """
    earlier, later = before.description.ran_with, after.description.ran_with
    keys = _combination_keys(before) & _combination_keys(after)
    names = []
    for name in earlier.keys() & later:
        if keys:
            sides = [(digests_of(earlier[name], key), digests_of(later[name], key)) for key in keys]
        else:
            sides = [(all_digests(earlier[name]), all_digests(later[name]))]
        if any(had and has and not (had <= has or has <= had if keys else had & has) for had, has in sides):
            names.append(name)
    names.sort()
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return (f"other content of {', '.join(names[:MAX_NAMES])}{more}",) if names else ()


def _combination_keys(results: ExperimentResults) -> set[str]:
    factors = [factor.name for factor in results.description.factors]
    levels = results.episodes[factors].drop_duplicates().to_dict("records")
    return {combination_key({str(name): str(level) for name, level in each.items()}) for each in levels}


def commands_to_repeat(results: ExperimentResults, recorded: Sequence[RecordedValue], database: str) -> tuple[str, ...]:
    """Returns the commands that repeat the experiment and report it; none for a table of other programs.

    Args:
        results: Finished episodes.
        recorded: Recorded values of the snapshots.
        database: Database as named by the user.
    """
    if results.description.mode == MODE:
        return ()
    name = results.description.name
    file, again = shlex.quote(f"{name}.yaml"), shlex.quote(f"{name}_again.db")
    revisions = [item.values[0][0] for item in recorded if item.name.endswith("git_revision") and item.values]
    checkout = [f"git checkout {shlex.quote(revisions[0])} && ./install.sh"] if revisions else []
    compared = (
        f"{shlex.quote(PurePath(database).name)} {again}"
        if "://" not in database
        else f"{shlex.quote(database)} {again}"
    )
    return (
        *checkout,
        f"rosrun modular_framework_benchmark run_experiment {file} --database {again}",
        f"rosrun modular_framework_benchmark report {again}",
        f"rosrun modular_framework_benchmark compare {compared}",
    )
