# SPDX-License-Identifier: BSD-3-Clause
"""Says what was run, on what, and how to run it again."""

from __future__ import annotations

import shlex
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.records.what_ran import IMPLEMENTATION
from modular_framework_benchmark.reports.number_text import counted
from modular_framework_ros.reported_figures import Clock

SnapshotValues = Mapping[str, Sequence[tuple[Any, int]]]

MOST_VALUES = 4
MOST_PARAMETERS = 400
BUSY_SHARE = 0.1
"""Fraction of the machine that other processes may use before times in real time are doubtful."""
OF_ONE_EPISODE = (
    *("metric_faults", "earlier_tries", "reference_s"),
    *("load_before", "load_after", "stolen_s", "busy_s", "others_share"),
)
"""Parts of a snapshot that are measured or happen: summed up, not listed."""
_PER_EPISODE = ("seed", "trial", "number")  # differ between episodes by nature
_DECISIVE = (
    "revision",
    "version",
    "hostname",
    "machine",
    "cpu",
)  # an experiment with several of these is no one experiment


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """A value of the snapshots, such as a version.

    Attributes:
        name: Path of its keys: `versions.ompl`.
        values: The different values, each with the number of episodes that had it, most frequent first.
        others: How many further values are not listed.
    """

    name: str
    values: tuple[tuple[str, int], ...]
    others: int

    @property
    def is_decisive(self) -> bool:
        """Returns whether results of episodes that differ in it should not be taken together."""
        return any(word in self.name.lower() for word in _DECISIVE)


def recorded_values(snapshots: SnapshotValues) -> tuple[RecordedValue, ...]:
    """Returns the values that episodes ran with.

    Args:
        snapshots: the different values of each name of the snapshots, each with the number of episodes that had it.
    """
    counts: dict[str, dict[str, int]] = {}
    for name, values in snapshots.items():
        for value, episodes in values if name not in OF_ONE_EPISODE else ():
            for path, text in _leaves(value, name):
                of_path = counts.setdefault(path, {})
                of_path[text] = of_path.get(text, 0) + episodes
    recorded = []
    for name, of_name in counts.items():
        ordered = sorted(of_name.items(), key=lambda item: -item[1])
        recorded.append(RecordedValue(name, tuple(ordered[:MOST_VALUES]), max(len(ordered) - MOST_VALUES, 0)))
    return tuple(recorded[:MOST_PARAMETERS])


def _leaves(value: object, name: str) -> Iterator[tuple[str, str]]:
    """Yields the values of nested mappings with the paths of their keys; those that differ by nature are left out."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, f"{name}.{key}")
    elif name.rpartition(".")[2] not in _PER_EPISODE:
        yield name, ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def warnings_of(
    results: ExperimentResults, recorded: Sequence[RecordedValue], snapshots: SnapshotValues
) -> tuple[str, ...]:
    """Returns what a reader must know before the figures: unfinished or broken episodes, faults, several revisions.

    Args:
        results: the experiment.
        recorded: what its episodes ran with.
        snapshots: as for `recorded_values`.
    """
    episodes = results.episodes
    found = []
    if len(episodes) < results.planned:
        found.append(
            f"{len(episodes):,} of {counted(results.planned, 'planned episode')} are finished: figures are of these."
        )
    broken = episodes[episodes["status"] == "broken"]
    if len(broken):
        listed = ", ".join(str(number) for number in broken["number"].head(12))
        more = f" and {len(broken) - 12:,} more" if len(broken) > 12 else ""
        verb = "is" if len(broken) == 1 else "are"
        found.append(
            f"{counted(len(broken), 'episode')} {verb} broken: the launch died or the measurement failed (number "
            f"{listed}{more}). They count as failures; the table of comparisons says where a verdict rests on them."
        )
    for item in recorded:
        if item.is_decisive and len(item.values) + item.others > 1:
            values = "; ".join(f"{value} ({counted(count, 'episode')})" for value, count in item.values)
            found.append(f"The episodes did not all run with the same {item.name}: {values}.")
    return (*found, *_incidents(snapshots), *_load_warning(results, snapshots))


def _incidents(snapshots: SnapshotValues) -> Iterator[str]:
    """Yields faults of metrics, and tries of episodes that ended without a record."""
    faults: dict[str, list[tuple[str, int]]] = {}
    for value, episodes in snapshots.get("metric_faults", ()):
        for metric, text in value.items():
            faults.setdefault(metric, []).append((text, episodes))
    for metric, texts in faults.items():
        count = sum(episodes for _, episodes in texts)
        yield f"The metric {metric} raised an error in {counted(count, 'episode')}: {texts[0][0]}."
    tries = [text for value, episodes in snapshots.get("earlier_tries", ()) for text in value * episodes]
    if tries:
        yield f"{counted(len(tries), 'attempt')} ended without a record, and the episodes ran again: {tries[0]}."


def _load_warning(results: ExperimentResults, snapshots: SnapshotValues) -> Iterator[str]:
    shares = [(float(value), episodes) for value, episodes in snapshots.get("others_share", ())]
    busy = sum(episodes for share, episodes in shares if share > BUSY_SHARE)
    names = [metric.name for metric in results.description.metrics if metric.clock is Clock.WALL]
    if busy and names:
        yield (
            f"{counted(busy, 'episode')} ran beside other processes that used up to {100 * max(shares)[0]:.0f} % of "
            f"the machine: what is measured in real time is longer there ({', '.join(names)})."
        )


def differences_of(before: SnapshotValues, after: SnapshotValues) -> tuple[str, ...]:
    """Returns what two experiments ran with that is not the same: versions, planners, methods, machine, files.

    Args:
        before: what the episodes of the earlier experiment ran with, as for `recorded_values`.
        after: that of the later one.
    """
    earlier, later = _values_of(before), _values_of(after)
    found = []
    for name in dict.fromkeys([*earlier, *later]):
        if earlier.get(name) == later.get(name) or name.endswith(IMPLEMENTATION) and name not in earlier.keys() & later:
            continue
        sides = (", ".join(sorted(side.get(name, {"nothing"}))[:MOST_VALUES]) for side in (earlier, later))
        found.append(f"{name}: before {next(sides)}; after {next(sides)}")
    times = [[float(value) for value, _ in side.get("reference_s", ())] for side in (before, after)]
    if all(times) and any(text.startswith("machine.") for text in found):
        medians = [statistics.median(side) for side in times]
        found.append(
            f"the machines: the reference workload takes {medians[0]:.3f} s before and {medians[1]:.3f} s after "
            f"({medians[1] / medians[0]:.2f} times)"
        )
    return tuple(found)


def _values_of(snapshots: SnapshotValues) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for name, values in snapshots.items():
        for value, _ in values if name not in OF_ONE_EPISODE else ():
            for path, text in _leaves(value, name):
                found.setdefault(path, set()).add(text)
    return found


def commands_to_repeat(results: ExperimentResults, recorded: Sequence[RecordedValue], database: str) -> tuple[str, ...]:
    """Returns the commands that run the experiment again and report it.

    Args:
        results: the experiment.
        recorded: what its episodes ran with.
        database: the database, as the report was asked for.
    """
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
