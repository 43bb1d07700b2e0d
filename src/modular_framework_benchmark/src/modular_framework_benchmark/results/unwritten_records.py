# SPDX-License-Identifier: BSD-3-Clause
"""Keeps records that the database could not take as JSON files, until it can."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from modular_framework_benchmark.records.episode import EpisodeRecord
from modular_framework_benchmark.results.connection import DatabaseAddress
from modular_framework_benchmark.results.json_records import record_from_json, record_to_json, to_json
from modular_framework_core.files.atomic_files import read_text, write_atomically

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class UnwrittenRecord:
    """A record that waits in a file.

    Attributes:
        path: The file.
        experiment: Identifier of the experiment in the database.
        record: What the episode gave.
    """

    path: Path
    experiment: int
    record: EpisodeRecord


def waiting_folders(address: DatabaseAddress) -> list[Path]:
    """Returns the folders where records of a database may wait, the preferred one first.

    Beside the database; where ROS keeps its files; in the system's folder for temporary files: they lie on other file
    systems, as a rule, when the first one is full or read-only.
    """
    mark = hashlib.sha256(address.label.encode()).hexdigest()[:16]
    ros_home = Path(os.environ.get("ROS_HOME") or Path.home() / ".ros")
    others = [ros_home, Path(tempfile.gettempdir())]
    beside = [address.path.with_name(f"{address.path.name}.unwritten")] if address.path else []
    return beside + [folder / "modular_framework_benchmark" / "unwritten" / mark for folder in others]


def keep_record(address: DatabaseAddress, experiment: int, record: EpisodeRecord) -> Path | None:
    """Writes a record into the first folder that takes it.

    Returns:
        The file; None if no folder took it.
    """
    content = to_json(
        {"database": address.label, "experiment": experiment, "record": json.loads(record_to_json(record))}
    )
    name = hashlib.sha256(f"{experiment}\n{record.spec.key}".encode()).hexdigest()[:32]
    for folder in waiting_folders(address):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_atomically(folder / f"{name}.json", content)
        except OSError as error:
            _LOG.warning("%s takes no record: %s", folder, error)
            continue
        return folder / f"{name}.json"
    return None


def waiting_records(address: DatabaseAddress) -> Iterator[UnwrittenRecord]:
    """Reads the records that wait for a database; a file that cannot be read stays, with a warning."""
    for folder in waiting_folders(address):
        for path in sorted(folder.glob("*.json")):
            try:
                content = json.loads(read_text(path))
                yield UnwrittenRecord(path, int(content["experiment"]), record_from_json(json.dumps(content["record"])))
            except (OSError, ValueError, KeyError, TypeError) as error:
                _LOG.warning("%s: no record of an episode (%s); it is left there: repair or remove it", path, error)
