# SPDX-License-Identifier: BSD-3-Clause
"""Exports the tables of Planner Arena alone, as one SQLite file to send or to upload.

A result file can be opened in Planner Arena as it is. This export is for results on a server, and leaves out what
Planner Arena does not read: settings, snapshots, logs' folders.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Table, create_engine, insert, select

from modular_framework_benchmark.results.errors import ExportError

ARENA_TABLES = ("experiments", "plannerConfigs", "enums", "runs", "progress")
_BATCH = 10_000


def copy_arena_tables(source: Connection, tables: dict[str, Table], path: Path) -> None:
    """Copies Planner Arena's tables into a new SQLite file.

    Args:
        source: The result database.
        tables: Its tables by their names, with all their columns.
        path: The new file.

    Raises:
        ExportError: The file is there already.
    """
    if path.exists():
        raise ExportError(f"{path}: there already; remove it, or name another folder")
    path.parent.mkdir(parents=True, exist_ok=True)
    engine = create_engine(f"sqlite:///{path}")
    try:
        with engine.begin() as target:
            for name in ARENA_TABLES:
                _copy(source, target, tables[name])
    finally:
        engine.dispose()


def _copy(source: Connection, target: Connection, table: Table) -> None:
    columns = [column.copy() for column in table.columns]
    for column in columns:
        column.foreign_keys.clear()
    copy = Table(table.name, type(table.metadata)(), *columns)
    copy.create(target)
    rows: list[dict[str, Any]]
    result = source.execution_options(yield_per=_BATCH).execute(select(table))
    for batch in result.mappings().partitions():
        rows = [dict(row) for row in batch]
        target.execute(insert(copy), rows)
