# SPDX-License-Identifier: BSD-3-Clause
"""Keeps constraints by name in one SQLite file, laid out as the database plugin warehouse_ros_sqlite does (version 10).

So a real MoveIt with that plugin reads what is saved here, and the other way round. MongoDB is not spoken.
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

LAYOUT_VERSION = 10
DATABASE, COLLECTION = "moveit_constraints", "constraints"
TABLE = f"T_{DATABASE}@{COLLECTION}"
BUSY_S = 5.0
LAYOUT = f"""
CREATE TABLE IF NOT EXISTS WarehouseIndex (MangledTableName TEXT PRIMARY KEY, MessageMD5 BLOB NOT NULL,
    WarehouseCollectionName TEXT NOT NULL, WarehouseDatabaseName TEXT NOT NULL, MessageDataType TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS "{TABLE}" (Data BLOB NOT NULL, M_id INTEGER PRIMARY KEY AUTOINCREMENT,
    M_creation_time INTEGER, M_constraints_id BLOB, M_robot_id BLOB, M_group_id BLOB);
"""


class ConstraintsStorage:
    """Constraints of robots and their groups, in one file. An empty robot or group stands for any."""

    def __init__(self, path: str) -> None:
        """Opens a file; one that is not there yet is made when something is saved.

        Raises:
            MoveItCommanderException: it cannot be a file of constraints.
        """
        self.path = Path(path).expanduser()
        if not self.path.parent.is_dir() or (self.path.parent == Path() and not self.path.is_file()):
            raise MoveItCommanderException(
                f"constraints database '{path}': neither a file nor a path in a folder that "
                "is there; give the path of an SQLite file (MongoDB is not spoken here)"
            )
        if self.path.exists():
            with self._connected() as database:
                version = int(database.execute("PRAGMA user_version").fetchone()[0])
            if version not in (0, LAYOUT_VERSION):
                raise MoveItCommanderException(
                    f"constraints database {self.path}: layout {version}, {LAYOUT_VERSION} is needed; make it anew"
                )

    def add_constraints(self, msg: Constraints, robot: str = "", group: str = "") -> None:
        """Saves constraints under their own name, replacing those of that name."""
        if not msg.name:
            raise MoveItCommanderException(f"constraints database {self.path}: the constraints have no name; set .name")
        data = BytesIO()
        msg.serialize(data)
        where, values = _matching(msg.name, robot, group)
        with self._connected(create=True) as database:
            database.execute(f'DELETE FROM "{TABLE}"{where}', values)
            database.execute(
                f'INSERT INTO "{TABLE}" (Data, M_creation_time, M_constraints_id, M_robot_id, M_group_id) '
                "VALUES (?, ?, ?, ?, ?)",
                (data.getvalue(), int(time.time()), *(item.encode() for item in (msg.name, robot, group))),
            )

    def has_constraints(self, name: str, robot: str = "", group: str = "") -> bool:
        """Returns whether there are constraints of that name."""
        return name in self.get_known_constraints(robot, group)

    def get_known_constraints(self, robot: str = "", group: str = "") -> list[str]:
        """Returns the names, in order."""
        return sorted({name.decode() for name, _ in self._rows("", robot, group)})

    def get_constraints(self, name: str, robot: str = "", group: str = "") -> Constraints:
        """Returns constraints by name; raises MoveItCommanderException with the names there are."""
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
        """Gives constraints another name; an unknown one is no error."""
        self._change(f'UPDATE "{TABLE}" SET M_constraints_id = ?', (new_name.encode(),), old_name, robot, group)

    def remove_constraints(self, name: str, robot: str = "", group: str = "") -> None:
        """Drops constraints; an unknown name is no error."""
        self._change(f'DELETE FROM "{TABLE}"', (), name, robot, group)

    def _rows(self, name: str, robot: str, group: str) -> list[tuple[bytes, bytes]]:
        with self._connected() as database:
            if not _has_table(database):
                return []
            where, values = _matching(name, robot, group)
            return list(database.execute(f'SELECT M_constraints_id, Data FROM "{TABLE}"{where} ORDER BY M_id', values))

    def _change(self, command: str, first: tuple[bytes, ...], name: str, robot: str, group: str) -> None:
        with self._connected() as database:
            if _has_table(database):
                where, values = _matching(name, robot, group)
                database.execute(command + where, (*first, *values))

    @contextmanager
    def _connected(self, create: bool = False) -> Iterator[sqlite3.Connection]:
        """Opens the database and keeps its changes; without a file it is empty.

        Raises:
            MoveItCommanderException: the file cannot be read or written.
        """
        location = str(self.path) if create or self.path.exists() else ":memory:"
        try:
            with closing(sqlite3.connect(location, timeout=BUSY_S)) as database, database:
                if create:
                    _lay_out(database)
                yield database
        except sqlite3.Error as error:
            raise MoveItCommanderException(
                f"constraints database {self.path}: {error}; an SQLite file that can be read and written is needed"
            ) from error


def _has_table(database: sqlite3.Connection) -> bool:
    return database.execute("SELECT 1 FROM sqlite_master WHERE name = ?", (TABLE,)).fetchone() is not None


def _lay_out(database: sqlite3.Connection) -> None:
    database.executescript(LAYOUT)
    database.execute(f"PRAGMA user_version = {LAYOUT_VERSION}")
    database.execute(
        "INSERT OR IGNORE INTO WarehouseIndex VALUES (?, ?, ?, ?, ?)",
        (TABLE, bytes.fromhex(Constraints._md5sum), COLLECTION, DATABASE, Constraints._type),
    )


def _matching(name: str, robot: str, group: str) -> tuple[str, tuple[bytes, ...]]:
    """Returns the condition of a search and its values, as bytes like warehouse_ros_sqlite; empty names match all."""
    asked = {"M_constraints_id": name, "M_robot_id": robot, "M_group_id": group}
    wanted = {column: value.encode() for column, value in asked.items() if value}
    where = " AND ".join(f"{column} = ?" for column in wanted)
    return (f" WHERE {where}" if where else ""), tuple(wanted.values())
