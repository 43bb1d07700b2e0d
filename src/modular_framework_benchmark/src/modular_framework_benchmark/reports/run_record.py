# SPDX-License-Identifier: BSD-3-Clause
"""Says what was run, on what, and how to run it again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.reports.number_text import counted

SnapshotValues = Mapping[str, Sequence[tuple[Any, int]]]

MOST_VALUES = 4
MOST_PARAMETERS = 400
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
        for value, episodes in values:
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


def warnings_of(results: ExperimentResults, recorded: Sequence[RecordedValue]) -> tuple[str, ...]:
    """Returns what a reader must know before the figures: unfinished or broken episodes, more than one revision."""
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
    return tuple(found)


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
