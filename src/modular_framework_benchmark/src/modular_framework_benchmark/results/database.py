# SPDX-License-Identifier: BSD-3-Clause
"""Database of results: a SQLite file by default, or a server that SQLAlchemy supports.

Each finished episode is written exactly once, in one transaction. A killed run loses no finished episode and can be
resumed from the database.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import pandas as pd
from sqlalchemy import Connection, Engine, func, insert, inspect, select, update
from sqlalchemy.exc import DBAPIError, IntegrityError

from modular_framework_benchmark.records.episode import EpisodeRecord, EpisodeSpec
from modular_framework_benchmark.records.experiment import ExperimentDescription
from modular_framework_benchmark.records.results import ExperimentResults
from modular_framework_benchmark.results import result_tables
from modular_framework_benchmark.results.connection import (
    BEGIN_OPTION,
    BUSY_TIMEOUT_S,
    DatabaseAddress,
    make_engine,
    parse_address,
)
from modular_framework_benchmark.results.errors import (
    DatabaseCorruptError,
    RecordNotStoredError,
    RecordRefusedError,
    ResultsError,
    StorageError,
    UnknownExperimentError,
    storage_error,
)
from modular_framework_benchmark.results.finished_episodes import STATUS_VALUES, read_record, read_spec, store_record
from modular_framework_benchmark.results.json_records import description_from_json, record_to_json
from modular_framework_benchmark.results.planned_episodes import check_resumed, store_experiment
from modular_framework_benchmark.results.schema import (
    DESCRIPTIONS,
    ENUMS,
    EPISODES,
    METADATA,
    RUNS,
    SCHEMA,
    SCHEMA_VERSION,
)
from modular_framework_benchmark.results.schema_upgrade import stored_version, upgrade
from modular_framework_benchmark.results.unwritten_records import keep_record, waiting_records
from modular_framework_ros.allowed_names import nearest

_LOG = logging.getLogger(__name__)
_ATTEMPTS = 10
_Result = TypeVar("_Result")


@dataclass(frozen=True, slots=True)
class StoredExperiment:
    """An experiment of a database.

    Attributes:
        id: Identifier in the database.
        description: Description of the experiment.
        planned: Number of episodes.
        finished: Number of episodes with a record.
        added: Time of insertion [s since 1970].
    """

    id: int
    description: ExperimentDescription
    planned: int
    finished: int
    added: float


def open_database(
    target: str | Path, *, create: bool = False, read_only: bool = False, busy_timeout_s: float = BUSY_TIMEOUT_S
) -> ResultDatabase:
    """Opens, checks and upgrades a result database, and imports the records that wait beside the database.

    Args:
        target: Path of a SQLite file, or SQLAlchemy URL.
        create: Whether to create a missing database.
        read_only: Whether to refuse writes, except an upgrade of older tables.
        busy_timeout_s: Maximum wait for another process that writes the SQLite file [s].

    Raises:
        StorageError: The database is missing, damaged, locked or not writable.
        SchemaVersionError: The tables belong to a newer version or to another program.
    """
    address = parse_address(target)
    engine = make_engine(address, create=create, read_only=read_only, busy_timeout_s=busy_timeout_s)
    database = ResultDatabase(address, engine)
    try:
        if not database.prepare(read_only=read_only):
            open_database(target, busy_timeout_s=busy_timeout_s).close()
    except BaseException:
        database.close()
        raise
    return database


class ResultDatabase:
    """An open result database, created by `open_database`; each process opens its own."""

    def __init__(self, address: DatabaseAddress, engine: Engine) -> None:
        """Stores the arguments without connecting."""
        self._address = address
        self._engine = engine
        self._descriptions: dict[int, ExperimentDescription] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections; repeated calls are allowed."""
        self._engine.dispose()

    @property
    def label(self) -> str:
        """Returns the name of the database for messages."""
        return self._address.label

    @property
    def folder(self) -> Path:
        """Returns the base of the episodes' folders: the folder of the SQLite file, or the working directory."""
        return self._address.path.parent if self._address.path else Path.cwd()

    def prepare(self, *, read_only: bool) -> bool:
        """Checks the database, creates the tables of a new database, and imports waiting records; see `open_database`.

        Returns:
            Whether the tables have this release's version; tables opened read-only may be older.
        """
        self._check_integrity()
        if read_only:
            with self._reading() as connection:
                return stored_version(connection, self.label) == SCHEMA_VERSION
        with self._writing() as connection:
            if not inspect(connection).get_table_names():
                METADATA.create_all(connection)
                connection.execute(insert(SCHEMA).values(version=SCHEMA_VERSION))
                connection.execute(
                    insert(ENUMS),
                    [
                        {"name": "status", "value": value, "description": status.value}
                        for status, value in STATUS_VALUES.items()
                    ],
                )
            upgrade(connection, self._address)
            connection.execute(update(SCHEMA).values(version=SCHEMA_VERSION))  # fails early if not writable
        self._import_waiting()
        return True

    def add_experiment(self, description: ExperimentDescription, episodes: Sequence[EpisodeSpec]) -> int:
        """Adds an experiment, or the new episodes of an experiment to resume.

        Args:
            description: Description of the experiment.
            episodes: All episodes of the experiment.

        Returns:
            Identifier of the experiment in the database.

        Raises:
            DescriptionError: A name is not a valid column, or the episodes do not fit the description.
            ExperimentChangedError: The database has a different experiment of this name.
            StorageError: The database is not writable.
        """
        number = self._transact(lambda connection: store_experiment(connection, description, episodes))
        self._descriptions.pop(number, None)
        return number

    def experiments(self) -> list[StoredExperiment]:
        """Returns the experiments in the order of their insertion."""
        with self._reading() as connection:
            counts: dict[int, int] = dict(
                connection.execute(
                    select(EPISODES.c.descriptionid, func.count()).group_by(EPISODES.c.descriptionid)
                ).all()
            )
            finished: dict[int, int] = dict(
                connection.execute(
                    select(EPISODES.c.descriptionid, func.count())
                    .join_from(EPISODES, RUNS, RUNS.c.id == EPISODES.c.id)
                    .group_by(EPISODES.c.descriptionid)
                ).all()
            )
            rows = connection.execute(select(DESCRIPTIONS).order_by(DESCRIPTIONS.c.id)).all()
        return [
            StoredExperiment(
                row.id, description_from_json(row.content), counts.get(row.id, 0), finished.get(row.id, 0), row.added
            )
            for row in rows
        ]

    def find(self, name: str) -> int:
        """Returns the identifier of an experiment.

        Raises:
            UnknownExperimentError: The database has no experiment of this name; the error lists the known names.
        """
        with self._reading() as connection:
            ids = dict(connection.execute(select(DESCRIPTIONS.c.name, DESCRIPTIONS.c.id)).all())
        if name not in ids:
            raise UnknownExperimentError(
                f"{self.label} has no experiment {name!r}; allowed: {', '.join(sorted(ids)) or 'none, it is empty'}"
                + nearest(name, ids)
            )
        return int(ids[name])

    def check_resumed(self, number: int, ran_with: Mapping[str, str]) -> None:
        """Checks that the remaining episodes run with the files, packages and parameters of the finished episodes.

        Args:
            number: Identifier of the experiment.
            ran_with: Digests for the remaining episodes, see `run_digests`.

        Raises:
            ExperimentChangedError: A file, a package or a parameter is different.
        """
        pending = self.pending(number)
        with self._reading() as connection:
            check_resumed(self._description(connection, number), ran_with, pending)

    def pending(self, number: int) -> list[EpisodeSpec]:
        """Returns the unfinished episodes of an experiment in the order of the run."""
        with self._reading() as connection:
            mode = self._description(connection, number).mode
            statement = (
                select(EPISODES)
                .outerjoin(RUNS, RUNS.c.id == EPISODES.c.id)
                .where(EPISODES.c.descriptionid == number, RUNS.c.id.is_(None))
                .order_by(EPISODES.c.number)
            )
            return [read_spec(row, mode) for row in connection.execute(statement)]

    def write(self, number: int, record: EpisodeRecord) -> bool:
        """Writes the record of an episode in one transaction.

        Args:
            number: Identifier of the experiment.
            record: Record of the episode.

        Returns:
            True if the record was stored; False if the episode had a record, which is kept.

        Raises:
            RecordNotStoredError: The database is not writable; the record is saved in a file, which is imported when
                the database is next opened.
            RecordRefusedError: The record does not fit the experiment.
            UnknownExperimentError: The database lacks the experiment.
        """
        try:
            content = record_to_json(record)
        except TypeError as error:
            raise RecordRefusedError(f"episode {record.spec.key!r}: {error}") from error
        try:
            return self._transact(
                lambda connection: store_record(connection, number, self._description(connection, number), record)
            )
        except StorageError as error:
            saved = keep_record(self._address, number, record)
            raise RecordNotStoredError(error, record.spec.key, saved, content) from error

    def record(self, number: int, episode: int) -> EpisodeRecord:
        """Returns the complete record of an episode.

        Args:
            number: Identifier of the experiment.
            episode: Number of the episode in the experiment.

        Raises:
            UnknownExperimentError: The database lacks the experiment.
            ResultsError: The episode does not exist, or is not finished.
        """
        with self._reading() as connection:
            description = self._description(connection, number)
            row = connection.execute(
                select(EPISODES).where(EPISODES.c.descriptionid == number, EPISODES.c.number == episode)
            ).one_or_none()
            record = None if row is None else read_record(connection, row, description)
        if record is None:
            state = "is not finished" if row is not None else "does not exist"
            raise ResultsError(
                f"{self.label}: episode {episode} of {description.name!r} {state}; name a finished episode"
            )
        return record

    def load(self, number: int, *, spans: bool = True) -> ExperimentResults:
        """Returns the finished episodes of an experiment, which may still be running.

        Args:
            number: Identifier of the experiment.
            spans: Whether to read the spans; otherwise their table is empty.

        Raises:
            UnknownExperimentError: The database lacks the experiment.
        """
        with self._reading() as connection:
            return result_tables.load_results(connection, number, self._description(connection, number), spans=spans)

    def spans(self, number: int, episodes: Collection[int]) -> pd.DataFrame:
        """Returns the spans of the given episodes with the columns of `ExperimentResults.spans`."""
        with self._reading() as connection:
            self._description(connection, number)
            return result_tables.load_spans(connection, number, episodes)

    def span_totals(self, number: int) -> pd.DataFrame:
        """Returns the sums of an experiment's spans by kind, name and method; see `result_tables.span_totals`."""
        with self._reading() as connection:
            return result_tables.span_totals(connection, number, self._description(connection, number))

    def milestone_levels(self, number: int) -> dict[str, list[dict[str, str]]]:
        """Returns the combinations of levels at which episodes have each milestone, keyed by milestone."""
        with self._reading() as connection:
            self._description(connection, number)
            return result_tables.milestone_levels(connection, number)

    def snapshot_values(self, number: int, leave_out: Collection[str] = ()) -> dict[str, list[tuple[Any, int]]]:
        """Returns the distinct values of each part of the snapshots, with their numbers of episodes."""
        with self._reading() as connection:
            self._description(connection, number)
            return result_tables.snapshot_values(connection, number, leave_out)

    def combination_snapshots(
        self, number: int, leave_out: Collection[str] = ()
    ) -> dict[str, dict[str, list[tuple[Any, int]]]]:
        """Returns the values of `snapshot_values` by combination of levels."""
        with self._reading() as connection:
            self._description(connection, number)
            return result_tables.combination_snapshots(connection, number, leave_out)

    def _description(self, connection: Connection, number: int) -> ExperimentDescription:
        if number not in self._descriptions:
            row = connection.execute(select(DESCRIPTIONS.c.content).where(DESCRIPTIONS.c.id == number)).one_or_none()
            if row is None:
                raise UnknownExperimentError(f"{self.label} has no experiment number {number}; see experiments()")
            self._descriptions[number] = description_from_json(row.content)
        return self._descriptions[number]

    def _mode_of(self, number: int) -> str:
        with self._reading() as connection:
            return self._description(connection, number).mode

    def _transact(self, action: Callable[[Connection], _Result]) -> _Result:
        """Runs an action in a transaction; repeats it if another process wrote the same row simultaneously."""
        for attempt in range(_ATTEMPTS):
            try:
                with self._writing() as connection:
                    return action(connection)
            except IntegrityError as error:
                if attempt + 1 == _ATTEMPTS:
                    raise storage_error(error, self.label) from error
        raise AssertionError("not reached")

    @contextlib.contextmanager
    def _writing(self) -> Iterator[Connection]:
        with self._translating(), self._engine.connect() as connection:
            writer = connection.execution_options(**{BEGIN_OPTION: "BEGIN IMMEDIATE"})
            with writer.begin():
                yield writer

    @contextlib.contextmanager
    def _reading(self) -> Iterator[Connection]:
        with self._translating(), self._engine.connect() as connection, connection.begin():
            yield connection

    @contextlib.contextmanager
    def _translating(self) -> Iterator[None]:
        try:
            yield
        except IntegrityError:
            raise
        except DBAPIError as error:
            raise storage_error(error, self.label) from error

    def _check_integrity(self) -> None:
        if self._address.path is None:
            return
        with self._reading() as connection:
            result = " ".join(connection.exec_driver_sql("PRAGMA quick_check(1)").scalar_one().split())
        if result != "ok":
            raise DatabaseCorruptError(
                f"{self.label}: it is damaged ({result}); restore a copy, or recover its data with sqlite3 .recover"
            )

    def _import_waiting(self) -> None:
        for waiting in waiting_records(self._address, self._mode_of):
            try:
                self.write(waiting.experiment, waiting.record)
            except RecordRefusedError as error:
                _LOG.warning("%s: the record remains unimported: %s", waiting.path, error)
                continue
            waiting.path.unlink(missing_ok=True)
            _LOG.info("%s: its record was imported into %s", waiting.path, self.label)
