# SPDX-License-Identifier: BSD-3-Clause
"""Errors of the result database: each says which file, what was found, what is allowed and what to do."""

from __future__ import annotations

from pathlib import Path

from sqlalchemy.exc import DBAPIError


class ResultsError(Exception):
    """Base of the errors of this room."""


class StorageError(ResultsError):
    """The database cannot be reached, read or written; an episode that could not be written is kept beside it."""


class DatabaseMissingError(StorageError):
    """There is no such file or folder."""


class DatabaseFullError(StorageError):
    """The disk is full, or the file reached its largest size."""


class DatabaseReadOnlyError(StorageError):
    """The file, its folder or its file system may not be written."""


class DatabaseLockedError(StorageError):
    """Another process kept it locked."""


class DatabaseCorruptError(StorageError):
    """The file is damaged, or no SQLite file."""


class SchemaVersionError(ResultsError):
    """The database has the tables of a newer version, or of another program."""


class UnknownExperimentError(ResultsError):
    """The database has no such experiment."""


class ExperimentChangedError(ResultsError):
    """An experiment of this name is in the database already, and it was another one."""


class DescriptionError(ResultsError):
    """The description or the episodes of an experiment cannot be stored."""


class RecordRefusedError(ResultsError):
    """The record of an episode does not fit its experiment."""


class ExportError(ResultsError):
    """Results cannot be exported."""


class RecordNotStoredError(ResultsError):
    """The database could not be written; the record is kept in a file.

    Attributes:
        saved_to: The file with the record; None if no file could be written either.
        record_json: The record as JSON.
    """

    def __init__(self, cause: StorageError, key: str, saved_to: Path | None, record_json: str) -> None:
        kept = (
            f"the record of the episode is kept in {saved_to} and taken in when the database is next opened for writing"
            if saved_to
            else f"no folder could take the record either, so here it is: {record_json}"
        )
        super().__init__(f"{cause}; episode {key!r} is finished: {kept}")
        self.saved_to = saved_to
        self.record_json = record_json


_ADVICE: dict[str, tuple[type[StorageError], str]] = {
    "SQLITE_FULL": (DatabaseFullError, "the disk is full; free space, then resume"),
    "SQLITE_READONLY": (
        DatabaseReadOnlyError,
        "it cannot be written; give write permission to the file and its folder, or name another file",
    ),
    "SQLITE_BUSY": (DatabaseLockedError, "another process keeps it locked; end that process, then resume"),
    "SQLITE_LOCKED": (DatabaseLockedError, "another process keeps it locked; end that process, then resume"),
    "SQLITE_CORRUPT": (
        DatabaseCorruptError,
        "it is damaged; restore a copy, or save what can be read with sqlite3 .recover",
    ),
    "SQLITE_NOTADB": (DatabaseCorruptError, "it is no SQLite file; name a result database"),
    "SQLITE_CANTOPEN": (
        DatabaseMissingError,
        "it cannot be opened; its folder must be there, and the file readable: make the folder, or name another file",
    ),
    "SQLITE_IOERR": (
        DatabaseFullError,
        "reading or writing failed; look for a full disk, a quota, a limit of the size of files or a failing disk",
    ),
}


def storage_error(error: DBAPIError, where: str) -> StorageError:
    """Returns the error of this room that stands for an error of the database.

    Args:
        error: What SQLAlchemy raised.
        where: The database, as the user named it.
    """
    name = str(getattr(error.orig, "sqlite_errorname", ""))
    for prefix, (kind, advice) in _ADVICE.items():
        if name.startswith(prefix):
            return kind(f"{where}: {advice} ({error.orig})")
    return StorageError(f"{where}: the database refused ({error.orig}); see that it runs and may be used, then resume")
