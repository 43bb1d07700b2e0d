# SPDX-License-Identifier: BSD-3-Clause
"""Saves records that the database cannot store as JSON files, for a later import."""

from __future__ import annotations

import errno
import hashlib
import json
import logging
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from modular_framework_benchmark.records.episode import EpisodeRecord
from modular_framework_benchmark.results.connection import DatabaseAddress
from modular_framework_benchmark.results.errors import UnknownExperimentError
from modular_framework_benchmark.results.json_records import record_from_json, record_to_json, to_json
from modular_framework_core.files.atomic_files import read_text, write_atomically

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class UnwrittenRecord:
    """A record that waits in a file for its import.

    Attributes:
        path: File of the record.
        experiment: Identifier of the experiment in the database.
        record: Record of the episode.
    """

    path: Path
    experiment: int
    record: EpisodeRecord


def waiting_folders(address: DatabaseAddress) -> list[Path]:
    """Returns the folders for waiting records of a database, the preferred folder first.

    The folders are beside the database, in the ROS home and in the temporary folder. The latter two are usually on
    other file systems, which helps if the first is full or read-only.
    """
    mark = hashlib.sha256(address.identity.encode()).hexdigest()[:16]
    ros_home = Path(os.environ.get("ROS_HOME") or Path.home() / ".ros")
    other_folders = [ros_home, Path(tempfile.gettempdir())]
    beside = [address.path.with_name(f"{address.path.name}.unwritten")] if address.path else []
    return beside + [folder / "modular_framework_benchmark" / "unwritten" / mark for folder in other_folders]


def keep_record(address: DatabaseAddress, experiment: int, record: EpisodeRecord) -> Path | None:
    """Writes a record into the first writable folder.

    Args:
        address: Address of the database.
        experiment: Identifier of the experiment.
        record: Record of the episode.

    Returns:
        Path of the file, or None without a writable folder.
    """
    content = to_json(
        {"database": address.label, "experiment": experiment, "record": json.loads(record_to_json(record))}
    )
    name = hashlib.sha256(f"{experiment}\n{record.spec.key}".encode()).hexdigest()[:32]
    for folder in waiting_folders(address):
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            _require_own(folder)
            write_atomically(folder / f"{name}.json", content, mode=0o600)
        except OSError as error:
            _LOG.warning("%s cannot store a record: %s", folder, error)
            continue
        return folder / f"{name}.json"
    return None


def _require_own(path: Path) -> None:
    """Raises PermissionError unless the user owns the path and no other user may write it."""
    status = path.lstat()
    if stat.S_ISLNK(status.st_mode) or status.st_uid != os.geteuid() or status.st_mode & 0o022:
        raise PermissionError(
            errno.EPERM, f"other users may write it ({stat.filemode(status.st_mode)}, user {status.st_uid})", str(path)
        )


def waiting_records(address: DatabaseAddress, mode_of: Callable[[int], str]) -> Iterator[UnwrittenRecord]:
    """Yields the records that wait for a database; an unreadable file is kept, with a warning.

    Files and folders that another user owns or may write are ignored.

    Args:
        address: Address of the database.
        mode_of: Function that returns the mode of an experiment, or raises UnknownExperimentError.
    """
    for folder in waiting_folders(address):
        try:
            if not os.path.lexists(folder):
                continue
            _require_own(folder)
            paths = sorted(folder.glob("*.json"))
        except OSError as error:
            _LOG.warning(
                "records in %s are not imported: %s; remove it, or make it your own (chmod 700)", folder, error
            )
            continue
        for path in paths:
            try:
                _require_own(path)
                content = json.loads(read_text(path))
                number = int(content["experiment"])
                yield UnwrittenRecord(path, number, record_from_json(content["record"], mode_of(number)))
            except PermissionError as error:
                _LOG.warning("%s is not imported: %s; remove it, or make it your own (chmod 600)", path, error)
            except UnknownExperimentError as error:
                _LOG.warning("%s: the record remains unimported: %s", path, error)
            except (OSError, ValueError, KeyError, TypeError) as error:
                _LOG.warning("%s: not a record of an episode (%s); it is kept: repair or remove it", path, error)
