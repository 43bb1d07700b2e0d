# SPDX-License-Identifier: BSD-3-Clause
"""Describes the run of an experiment: software, machine, incidents, and commands that repeat the run."""

from __future__ import annotations

import shlex
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from modular_framework_benchmark.records.experiment import ExperimentDescription
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.records.used_software import IMPLEMENTATION
from modular_framework_benchmark.reports.number_text import counted
from modular_framework_ros.reported_figures import Clock

SnapshotValues = Mapping[str, Sequence[tuple[Any, int]]]

SETTINGS = "settings"
"""Snapshot part with the settings of an episode."""
MAX_VALUES = 4
MAX_NAMES = 12
MAX_PARAMETERS = 400
MAX_OTHERS_FRACTION = 0.1
"""Fraction of the machine used by other processes above which real times are doubtful."""
MEASURED_PARTS = (
    *("metric_faults", "earlier_tries", "reference_s"),
    *("load_before", "load_after", "stolen_s", "busy_s", "others_share"),
)
"""Measured parts of a snapshot, which are summarised instead of listed."""
_PER_EPISODE = ("seed", "trial", "number")  # differ between episodes by nature
_IDENTITY_WORDS = (
    "revision",
    "version",
    "hostname",
    "machine",
    "cpu",
)  # an experiment whose episodes differ in these is inconsistent


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """A recorded value of the snapshots, such as a version.

    Attributes:
        name: Path of keys: `versions.ompl`.
        values: Distinct values with their numbers of episodes, most frequent first.
        others: Number of distinct values that are not listed.
    """

    name: str
    values: tuple[tuple[str, int], ...]
    others: int

    @property
    def is_decisive(self) -> bool:
        """Returns whether episodes that differ in this value should not be pooled."""
        return any(word in self.name.lower() for word in _IDENTITY_WORDS)


def recorded_values(snapshots: SnapshotValues) -> tuple[RecordedValue, ...]:
    """Returns the recorded values of the snapshots.

    Args:
        snapshots: Distinct values of each snapshot part with their numbers of episodes.
    """
    counts: dict[str, dict[str, int]] = {}
    for name, values in snapshots.items():
        for value, episodes in values if name not in MEASURED_PARTS else ():
            for path, text in _leaves(value, name):
                of_path = counts.setdefault(path, {})
                of_path[text] = of_path.get(text, 0) + episodes
    recorded = []
    for name, of_name in counts.items():
        ordered = sorted(of_name.items(), key=lambda item: -item[1])
        recorded.append(RecordedValue(name, tuple(ordered[:MAX_VALUES]), max(len(ordered) - MAX_VALUES, 0)))
    return tuple(recorded[:MAX_PARAMETERS])


def _leaves(value: object, name: str) -> Iterator[tuple[str, str]]:
    """Yields the leaf values of nested mappings with key paths, except those that differ by nature."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, f"{name}.{key}")
    elif name.rpartition(".")[2] not in _PER_EPISODE:
        yield name, ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def warnings_of(
    results: ExperimentResults, recorded: Sequence[RecordedValue], snapshots: SnapshotValues
) -> tuple[str, ...]:
    """Returns the warnings of a report: unfinished or broken episodes, faults, inconsistent revisions.

    Args:
        results: Finished episodes.
        recorded: Recorded values of the snapshots.
        snapshots: Distinct values of each snapshot part, as for `recorded_values`.
    """
    episodes = results.episodes
    found = []
    if len(episodes) < results.planned:
        found.append(
            f"{len(episodes):,} of {counted(results.planned, 'planned episode')} are finished; figures cover these."
        )
    broken = episodes[episodes["status"] == "broken"]
    if len(broken):
        numbers = ", ".join(str(number) for number in broken["number"].head(12))
        more = f" and {len(broken) - 12:,} more" if len(broken) > 12 else ""
        verb = "is" if len(broken) == 1 else "are"
        found.append(
            f"{counted(len(broken), 'episode')} {verb} broken: the launch died or the measurement failed (number "
            f"{numbers}{more}). They count as failures; the comparisons name the verdicts that depend on them."
        )
    for item in recorded:
        if item.is_decisive and len(item.values) + item.others > 1:
            values = "; ".join(f"{value} ({counted(count, 'episode')})" for value, count in item.values)
            found.append(f"The episodes did not all run with the same {item.name}: {values}.")
    return (*found, *_incidents(snapshots), *_load_warning(results, snapshots))


def _incidents(snapshots: SnapshotValues) -> Iterator[str]:
    """Yields errors of metrics, and attempts of episodes that ended without a record."""
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


def others_fractions(snapshots: SnapshotValues) -> list[float]:
    """Returns the fraction of the machine that other processes used during each episode that recorded the load."""
    recorded = snapshots.get("others_share", ())
    return [float(value) for value, episodes in recorded for _ in range(episodes)]


def _load_warning(results: ExperimentResults, snapshots: SnapshotValues) -> Iterator[str]:
    fractions = others_fractions(snapshots)
    busy = sum(fraction > MAX_OTHERS_FRACTION for fraction in fractions)
    names = [metric.name for metric in results.description.metrics if metric.clock is Clock.WALL]
    if busy and names:
        yield (
            f"{counted(busy, 'episode')} ran beside other processes that used up to {100 * max(fractions):.0f} % of "
            f"the machine, which lengthens real times ({', '.join(names)})."
        )


def differences_of(before: SnapshotValues, after: SnapshotValues) -> tuple[str, ...]:
    """Returns the differences between the runs of two experiments: versions, planners, methods, machine, settings.

    Args:
        before: Snapshots of the earlier experiment, as for `recorded_values`, with the settings.
        after: Snapshots of the later experiment.
    """
    earlier, later = _values_of(before), _values_of(after)
    found = []
    for name in dict.fromkeys([*earlier, *later]):
        sides = [side.get(name, {"nothing"}) for side in (earlier, later)]
        # factors, trials and seeds vary the settings; experiments of the same design share values
        is_same = bool(sides[0] & sides[1]) if name.startswith(f"{SETTINGS}.") else sides[0] == sides[1]
        if is_same or name.endswith(IMPLEMENTATION) and name not in earlier.keys() & later:
            continue
        texts = [", ".join(sorted(side)[:MAX_VALUES]) for side in sides]
        found.append(f"{name}: before {texts[0]}; after {texts[1]}")
    times = [[float(value) for value, _ in side.get("reference_s", ())] for side in (before, after)]
    if all(times) and any(text.startswith("machine.") for text in found):
        medians = [statistics.median(side) for side in times]
        found.append(
            f"the machines: the reference workload takes {medians[0]:.3f} s before and {medians[1]:.3f} s after "
            f"({medians[1] / medians[0]:.2f} times)"
        )
    return tuple(found)


def content_differences(before: ExperimentDescription, after: ExperimentDescription) -> tuple[str, ...]:
    """Returns the files, packages and parameters whose content differs, by digest.

    Args:
        before: Description of the earlier experiment.
        after: Description of the later experiment.
    """
    names = [
        name
        for name, digests in before.ran_with.items()
        if name in after.ran_with and not set(digests.split()) & set(after.ran_with[name].split())
    ]
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return (f"other content of {', '.join(names[:MAX_NAMES])}{more}",) if names else ()


def _values_of(snapshots: SnapshotValues) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for name, values in snapshots.items():
        for value, _ in values if name not in MEASURED_PARTS else ():
            for path, text in _leaves(value, name):
                found.setdefault(path, set()).add(text)
    return found


def commands_to_repeat(results: ExperimentResults, recorded: Sequence[RecordedValue], database: str) -> tuple[str, ...]:
    """Returns the commands that repeat the experiment and report it.

    Args:
        results: Finished episodes.
        recorded: Recorded values of the snapshots.
        database: Database as named by the user.
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
