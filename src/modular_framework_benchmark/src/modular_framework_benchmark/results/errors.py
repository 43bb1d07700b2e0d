# SPDX-License-Identifier: BSD-3-Clause
"""Errors of the result database; each message names the file, the fault, the allowed values and the remedy."""

from __future__ import annotations

from pathlib import Path

from sqlalchemy.exc import DBAPIError


class ResultsError(Exception):
    """Base class of the errors of results."""


class StorageError(ResultsError):
    """The database is unreachable, unreadable or not writable; the record of an episode is saved in a file."""


class DatabaseMissingError(StorageError):
    """The file or folder does not exist."""


class DatabaseFullError(StorageError):
    """The disk is full, or the file has reached its maximum size."""


class DatabaseReadOnlyError(StorageError):
    """The file, its folder or its file system is not writable."""


class DatabaseLockedError(StorageError):
    """Another process holds the lock of the database."""


class DatabaseCorruptError(StorageError):
    """The file is damaged, or is not a SQLite file."""


class SchemaVersionError(ResultsError):
    """The tables belong to a newer version or to another program."""


class UnknownExperimentError(ResultsError):
    """The database lacks the experiment."""


class ExperimentChangedError(ResultsError):
    """The database has a different experiment of this name."""


class DescriptionError(ResultsError):
    """The description or the episodes of an experiment cannot be stored."""


class RecordRefusedError(ResultsError):
    """The record of an episode does not fit its experiment."""


class ExportError(ResultsError):
    """The results cannot be exported."""


class RecordNotStoredError(ResultsError):
    """The database is not writable; the record is saved in a file.

    Attributes:
        saved_to: File with the record; None if no file could be written.
    """

    def __init__(self, cause: StorageError, key: str, saved_to: Path | None, record_json: str) -> None:
        kept = (
            f"its record is saved in {saved_to} and will be imported when the database is next opened for writing"
            if saved_to
            else f"no folder could store the record, which is: {record_json}"
        )
        super().__init__(f"{cause}; episode {key!r} is finished: {kept}")
        self.saved_to = saved_to


_ADVICE: dict[str, tuple[type[StorageError], str]] = {
    "SQLITE_FULL": (DatabaseFullError, "the disk is full; free space, then resume"),
    "SQLITE_READONLY": (
        DatabaseReadOnlyError,
        "it cannot be written; give write permission to the file and its folder, or name another file",
    ),
    "SQLITE_BUSY": (DatabaseLockedError, "another process holds its lock; end that process, then resume"),
    "SQLITE_LOCKED": (DatabaseLockedError, "another process holds its lock; end that process, then resume"),
    "SQLITE_CORRUPT": (
        DatabaseCorruptError,
        "it is damaged; restore a copy, or recover its data with sqlite3 .recover",
    ),
    "SQLITE_NOTADB": (DatabaseCorruptError, "it is not a SQLite file; name a result database"),
    "SQLITE_CANTOPEN": (
        DatabaseMissingError,
        "it cannot be opened; create its folder, make the file readable, or name another file",
    ),
    "SQLITE_IOERR": (
        DatabaseFullError,
        "reading or writing failed; check for a full disk, a quota, a file size limit or a failing disk",
    ),
}


def storage_error(error: DBAPIError, where: str) -> StorageError:
    """Returns the storage error that corresponds to an error of the database.

    Args:
        error: Error from SQLAlchemy.
        where: Label of the database.
    """
    name = str(getattr(error.orig, "sqlite_errorname", ""))
    for prefix, (kind, advice) in _ADVICE.items():
        if name.startswith(prefix):
            return kind(f"{where}: {advice} ({error.orig})")
    return StorageError(
        f"{where}: the database refused ({error.orig}); check that it runs and permits access, then resume"
    )
