# SPDX-License-Identifier: BSD-3-Clause
"""Stores named constraints in an SQLite file with the schema of the plugin warehouse_ros_sqlite (version 10).

MoveIt with that plugin can read the saved constraints and vice versa. MongoDB is not supported.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from io import BytesIO
from pathlib import Path

from moveit_msgs.msg import Constraints

from moveit_commander.exception import MoveItCommanderException

SCHEMA_VERSION = 10
DATABASE, COLLECTION = "moveit_constraints", "constraints"
TABLE = f"T_{DATABASE}@{COLLECTION}"
BUSY_S = 5.0
SCHEMA = f"""
CREATE TABLE IF NOT EXISTS WarehouseIndex (MangledTableName TEXT PRIMARY KEY, MessageMD5 BLOB NOT NULL,
    WarehouseCollectionName TEXT NOT NULL, WarehouseDatabaseName TEXT NOT NULL, MessageDataType TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS "{TABLE}" (Data BLOB NOT NULL, M_id INTEGER PRIMARY KEY AUTOINCREMENT,
    M_creation_time INTEGER, M_constraints_id BLOB, M_robot_id BLOB, M_group_id BLOB);
"""


class ConstraintsStorage:
    """Constraints of robots and groups in one file; an empty robot or group matches any."""

    def __init__(self, path: str) -> None:
        """Opens a file; a missing file is created when constraints are saved.

        Raises:
            MoveItCommanderException: The path cannot be a file of constraints.
        """
        self.path = Path(path).expanduser()
        if not self.path.parent.is_dir() or (self.path.parent == Path() and not self.path.is_file()):
            raise MoveItCommanderException(
                f"constraints database '{path}': neither a file nor a path in an existing folder; give the path of an "
                "SQLite file (MongoDB is not supported)"
            )
        if self.path.exists():
            with self._transaction() as database:
                version = int(database.execute("PRAGMA user_version").fetchone()[0])
            if version not in (0, SCHEMA_VERSION):
                raise MoveItCommanderException(
                    f"constraints database {self.path}: schema {version}, {SCHEMA_VERSION} is needed; create a new file"
                )

    def add_constraints(self, msg: Constraints, robot: str = "", group: str = "") -> None:
        """Saves constraints under their name and replaces existing constraints of this name.

        Args:
            msg: Constraints with a name.
            robot: Name of the robot; "" for any.
            group: Name of the planning group; "" for any.
        """
        if not msg.name:
            raise MoveItCommanderException(f"constraints database {self.path}: the constraints have no name; set .name")
        data = BytesIO()
        msg.serialize(data)
        where, values = _matching(msg.name, robot, group)
        with self._transaction(create=True) as database:
            database.execute(f'DELETE FROM "{TABLE}"{where}', values)
            database.execute(
                f'INSERT INTO "{TABLE}" (Data, M_creation_time, M_constraints_id, M_robot_id, M_group_id) '
                "VALUES (?, ?, ?, ?, ?)",
                (data.getvalue(), int(time.time()), *(item.encode() for item in (msg.name, robot, group))),
            )

    def has_constraints(self, name: str, robot: str = "", group: str = "") -> bool:
        """Returns whether constraints of this name exist.

        Args:
            name: Name of the constraints.
            robot: Name of the robot; "" for any.
            group: Name of the planning group; "" for any.
        """
        return name in self.get_known_constraints(robot, group)

    def get_known_constraints(self, robot: str = "", group: str = "") -> list[str]:
        """Returns the sorted names of the constraints."""
        return sorted({name.decode() for name, _ in self._rows("", robot, group)})

    def get_constraints(self, name: str, robot: str = "", group: str = "") -> Constraints:
        """Returns constraints by name.

        Args:
            name: Name of the constraints.
            robot: Name of the robot; "" for any.
            group: Name of the planning group; "" for any.

        Raises:
            MoveItCommanderException: The name is unknown; the error lists the known names.
        """
        rows = self._rows(name, robot, group)
        if not rows:
            raise MoveItCommanderException(
                f"constraints database {self.path}: no constraints '{name}' for robot "
                f"'{robot}' and group '{group}'; there are: "
                f"{', '.join(self.get_known_constraints(robot, group)) or 'none'}"
            )
        found = Constraints()
        found.deserialize(rows[-1][1])
        found.name = name
        return found

    def rename_constraints(self, old_name: str, new_name: str, robot: str = "", group: str = "") -> None:
        """Renames constraints; an unknown name is ignored.

        Args:
            old_name: Current name.
            new_name: New name.
            robot: Name of the robot; "" for any.
            group: Name of the planning group; "" for any.
        """
        self._change(f'UPDATE "{TABLE}" SET M_constraints_id = ?', (new_name.encode(),), old_name, robot, group)

    def remove_constraints(self, name: str, robot: str = "", group: str = "") -> None:
        """Removes constraints; an unknown name is ignored.

        Args:
            name: Name of the constraints.
            robot: Name of the robot; "" for any.
            group: Name of the planning group; "" for any.
        """
        self._change(f'DELETE FROM "{TABLE}"', (), name, robot, group)

    def _rows(self, name: str, robot: str, group: str) -> list[tuple[bytes, bytes]]:
        with self._transaction() as database:
            if not _has_table(database):
                return []
            where, values = _matching(name, robot, group)
            return list(database.execute(f'SELECT M_constraints_id, Data FROM "{TABLE}"{where} ORDER BY M_id', values))

    def _change(self, command: str, first: tuple[bytes, ...], name: str, robot: str, group: str) -> None:
        with self._transaction() as database:
            if _has_table(database):
                where, values = _matching(name, robot, group)
                database.execute(command + where, (*first, *values))

    @contextmanager
    def _transaction(self, create: bool = False) -> Iterator[sqlite3.Connection]:
        """Opens the database and commits its changes; a missing file is an empty database.

        Raises:
            MoveItCommanderException: The file is not readable or writable.
        """
        location = str(self.path) if create or self.path.exists() else ":memory:"
        try:
            with closing(sqlite3.connect(location, timeout=BUSY_S)) as database, database:
                if create:
                    _create_schema(database)
                yield database
        except sqlite3.Error as error:
            raise MoveItCommanderException(
                f"constraints database {self.path}: {error}; an SQLite file that can be read and written is needed"
            ) from error


def _has_table(database: sqlite3.Connection) -> bool:
    return database.execute("SELECT 1 FROM sqlite_master WHERE name = ?", (TABLE,)).fetchone() is not None


def _create_schema(database: sqlite3.Connection) -> None:
    database.executescript(SCHEMA)
    database.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
    database.execute(
        "INSERT OR IGNORE INTO WarehouseIndex VALUES (?, ?, ?, ?, ?)",
        (TABLE, bytes.fromhex(Constraints._md5sum), COLLECTION, DATABASE, Constraints._type),
    )


def _matching(name: str, robot: str, group: str) -> tuple[str, tuple[bytes, ...]]:
    """Returns the SQL condition of a search and its values as bytes; empty names match all."""
    conditions = {"M_constraints_id": name, "M_robot_id": robot, "M_group_id": group}
    given = {column: value.encode() for column, value in conditions.items() if value}
    where = " AND ".join(f"{column} = ?" for column in given)
    return (f" WHERE {where}" if where else ""), tuple(given.values())
