# SPDX-License-Identifier: BSD-3-Clause
"""Upgrades the tables of an older release version by version, and keeps a copy of the database.

A SQLite file is copied beside the original. On a server, each changed table is copied within the database. Copy and
upgrade are one transaction: an upgrade that fails or is killed leaves the old tables.
"""

from __future__ import annotations

import contextlib
import json
import logging
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table, insert, inspect, select, update

from modular_framework_benchmark.results.connection import DatabaseAddress
from modular_framework_benchmark.results.errors import DatabaseFullError, SchemaVersionError
from modular_framework_benchmark.results.schema import DESCRIPTIONS, ENUMS, SCHEMA, SCHEMA_VERSION

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Migration:
    """Upgrade of the tables from one version to the next.

    Attributes:
        changed: Tables whose rows or columns change.
        apply: Function that performs the change.
    """

    changed: tuple[Table, ...]
    apply: Callable[[Connection], None]


def stored_version(connection: Connection, label: str) -> int:
    """Returns the version of the tables.

    Raises:
        SchemaVersionError: The database belongs to another program, or has an unsupported version.
    """
    tables = inspect(connection).get_table_names()
    if SCHEMA.name not in tables:
        raise SchemaVersionError(
            f"{label} is not a result database: its tables are {', '.join(tables) or 'none'}; name another file"
        )
    version = int(connection.execute(select(SCHEMA.c.version)).scalar_one())
    if version > SCHEMA_VERSION:
        raise SchemaVersionError(
            f"{label} has tables of version {version}, of a newer release; allowed: {min(MIGRATIONS)} to "
            f"{SCHEMA_VERSION}; update this software, or name another database"
        )
    if version != SCHEMA_VERSION and version not in MIGRATIONS:
        raise SchemaVersionError(
            f"{label} has tables of version {version}, which no release has written; allowed: {min(MIGRATIONS)} to "
            f"{SCHEMA_VERSION}; restore a copy, or name another database"
        )
    return version


def upgrade(connection: Connection, address: DatabaseAddress) -> None:
    """Upgrades the tables to this release's version if they are older.

    Args:
        connection: Connection in a transaction that blocks other writers.
        address: Address of the database.

    Raises:
        SchemaVersionError: See `stored_version`.
        DatabaseFullError: The copy does not fit on the disk.
    """
    version = stored_version(connection, address.label)
    if version == SCHEMA_VERSION:
        return
    steps = [MIGRATIONS[number] for number in range(version, SCHEMA_VERSION)]
    kept = _copy_file(address.path, version) if address.path else _copy_tables(connection, steps, version)
    for step in steps:
        step.apply(connection)
    connection.execute(update(SCHEMA).values(version=SCHEMA_VERSION))
    _LOG.warning("%s: upgraded from version %d to %d of its tables; %s", address.label, version, SCHEMA_VERSION, kept)


def _copy_file(path: Path, version: int) -> str:
    names = (f"{path.name}.version_{version}{suffix}" for suffix in ("", *(f".{number}" for number in range(2, 1000))))
    copy = next(path.with_name(name) for name in names if not path.with_name(name).exists())
    try:
        with contextlib.closing(sqlite3.connect(path)) as old, contextlib.closing(sqlite3.connect(copy)) as new:
            old.backup(new)
    except sqlite3.Error as error:
        copy.unlink(missing_ok=True)
        raise DatabaseFullError(
            f"{path}: version {version} needs an upgrade, but its copy {copy} could not be written ({error}); free "
            "space and give write permission to the folder"
        ) from error
    return f"the original database is {copy}"


def _copy_tables(connection: Connection, steps: list[Migration], version: int) -> str:
    quote = connection.dialect.identifier_preparer.quote
    names = sorted({table.name for step in steps for table in step.changed})
    for name in names:
        copy = quote(f"{name}_version_{version}")
        connection.exec_driver_sql(f"CREATE TABLE {copy} AS SELECT * FROM {quote(name)}")
    return f"the original tables are {', '.join(f'{name}_version_{version}' for name in names)}"


_CLOCKS_OF_VERSION_1 = {
    "simulated time": ("task_time", "motion_duration", "execution_time", "grasp_time", "hold_time"),
    "real time": ("task_wall_time", "generation_time", "planning_time", "search_time", "solving_time"),
}


def _add_clocks(connection: Connection) -> None:
    """Upgrades version 1 to 2: descriptions name the clock and source of each metric; episodes may be invalid."""
    connection.execute(insert(ENUMS).values(name="status", value=4, description="invalid"))
    clocks = {name: clock for clock, names in _CLOCKS_OF_VERSION_1.items() for name in names}
    for row in connection.execute(select(DESCRIPTIONS.c.id, DESCRIPTIONS.c.content)).all():
        content: Mapping[str, Any] = json.loads(row.content)
        for metric in content["metrics"]:
            by_method = content["mode"] == "task" and metric["component"] == "generation"
            metric |= {
                "clock": clocks.get(metric["name"]) if metric["component"] != "own" else None,
                "source": "said by the method" if by_method else "measured",
            }
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        connection.execute(update(DESCRIPTIONS).where(DESCRIPTIONS.c.id == row.id).values(content=text))


MIGRATIONS: Mapping[int, Migration] = {1: Migration((DESCRIPTIONS, ENUMS), _add_clocks)}
"""Migrations, keyed by the version they start from."""
