# SPDX-License-Identifier: BSD-3-Clause
"""Keeps records that the database could not take as JSON files, until it can."""

from __future__ import annotations

import errno
import hashlib
import json
import logging
import os
import stat
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
    mark = hashlib.sha256(address.identity.encode()).hexdigest()[:16]
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
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            _require_own(folder)
            write_atomically(folder / f"{name}.json", content)
        except OSError as error:
            _LOG.warning("%s takes no record: %s", folder, error)
            continue
        return folder / f"{name}.json"
    return None


def _require_own(path: Path) -> None:
    """Raises PermissionError unless a file or folder is the user's own and nobody else may write it."""
    found = path.lstat()
    if stat.S_ISLNK(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o022:
        raise PermissionError(
            errno.EPERM, f"others could have filled it ({stat.filemode(found.st_mode)}, user {found.st_uid})", str(path)
        )


def waiting_records(address: DatabaseAddress) -> Iterator[UnwrittenRecord]:
    """Reads the records that wait for a database; a file that cannot be read stays, with a warning.

    Only files and folders count that belong to the user and that nobody else may write.
    """
    for folder in waiting_folders(address):
        try:
            if not os.path.lexists(folder):
                continue
            _require_own(folder)
            paths = sorted(folder.glob("*.json"))
        except OSError as error:
            _LOG.warning(
                "records in %s are not taken in: %s; remove it, or make it your own (chmod 700)", folder, error
            )
            continue
        for path in paths:
            try:
                _require_own(path)
                content = json.loads(read_text(path))
                yield UnwrittenRecord(path, int(content["experiment"]), record_from_json(json.dumps(content["record"])))
            except (OSError, ValueError, KeyError, TypeError) as error:
                _LOG.warning("%s: no record of an episode (%s); it is left there: repair or remove it", path, error)
