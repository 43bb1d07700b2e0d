# SPDX-License-Identifier: BSD-3-Clause
"""Constraints by name in an SQLite file, in the layout of MoveIt's database plugin."""

from __future__ import annotations

import sqlite3
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from moveit_commander import ConstraintsStorage, MoveItCommanderException
from moveit_commander.group_commands import GroupCommands, MoveGroupInfoLevel
from moveit_msgs.msg import Constraints, JointConstraint


def constraints(name: str, position: float = 0.0) -> Constraints:
    return Constraints(name=name, joint_constraints=[JointConstraint(joint_name="elbow", position=position)])


def test_constraints_are_saved_found_replaced_renamed_and_removed(tmp_path: Path) -> None:
    storage = ConstraintsStorage(str(tmp_path / "some.sqlite"))
    assert storage.get_known_constraints() == [] and not storage.path.exists(), "reading makes no file"
    storage.remove_constraints("nothing")
    for name, robot, group in (("low", "ur5", "arm"), ("high", "ur5", "arm"), ("low", "panda", "arm")):
        storage.add_constraints(constraints(name), robot, group)
    storage.add_constraints(constraints("low", 0.5), "ur5", "arm")
    again = ConstraintsStorage(str(storage.path))
    assert again.get_known_constraints("ur5", "arm") == ["high", "low"] == again.get_known_constraints()
    assert again.get_known_constraints("ur5", "hand") == []
    assert again.get_constraints("low", "ur5", "arm") == constraints("low", 0.5)
    assert again.get_constraints("low", "panda") == constraints("low"), "another robot's are its own"
    again.rename_constraints("low", "flat", "ur5", "arm")
    assert storage.get_constraints("flat", "ur5").name == "flat" and storage.has_constraints("low", "panda")
    storage.remove_constraints("flat")
    with pytest.raises(MoveItCommanderException, match="there are: high"):
        storage.get_constraints("flat", "ur5", "arm")


def test_the_file_is_laid_out_as_the_plugin_documents_it(tmp_path: Path) -> None:
    storage = ConstraintsStorage(str(tmp_path / "some.sqlite"))
    storage.add_constraints(constraints("low"), "ur5", "arm")
    data = BytesIO()
    constraints("low").serialize(data)
    with sqlite3.connect(storage.path) as database:
        assert database.execute("PRAGMA user_version").fetchone() == (10,)
        row = database.execute('SELECT * FROM "T_moveit_constraints@constraints"').fetchone()
        assert row[0] == data.getvalue() and row[1] == 1 and row[3:] == (b"low", b"ur5", b"arm")
        index = database.execute(
            "SELECT MangledTableName, MessageMD5, WarehouseCollectionName, WarehouseDatabaseName, "
            "MessageDataType FROM WarehouseIndex"
        ).fetchall()
    assert index == [
        (
            "T_moveit_constraints@constraints",
            bytes.fromhex(Constraints._md5sum),
            "constraints",
            "moveit_constraints",
            "moveit_msgs/Constraints",
        )
    ]


def test_what_is_no_file_of_constraints_is_refused_with_a_reason(tmp_path: Path) -> None:
    for place in ("localhost", str(tmp_path / "no_folder" / "some.sqlite")):
        with pytest.raises(MoveItCommanderException, match="MongoDB is not supported"):
            ConstraintsStorage(place)
    (tmp_path / "text.sqlite").write_text("this is no database, but it is long enough to look like a file of one")
    with pytest.raises(MoveItCommanderException, match="text.sqlite"):
        ConstraintsStorage(str(tmp_path / "text.sqlite"))
    with sqlite3.connect(tmp_path / "old.sqlite") as database:
        database.execute("PRAGMA user_version = 9")
    with pytest.raises(MoveItCommanderException, match="schema 9, 10 is needed"):
        ConstraintsStorage(str(tmp_path / "old.sqlite"))
    with pytest.raises(MoveItCommanderException, match="no name"):
        ConstraintsStorage(str(tmp_path / "new.sqlite")).add_constraints(Constraints())


def test_the_command_database_prints_which_file_is_used(tmp_path: Path) -> None:
    group = SimpleNamespace(constraints_storage=None)
    group.set_constraints_database = lambda host, _: setattr(group, "constraints_storage", ConstraintsStorage(host))
    commands = GroupCommands(group, None, "base")
    assert commands.database([]) == (MoveGroupInfoLevel.INFO, "Not connected to a database")
    place = str(tmp_path / "some.sqlite")
    connected = (MoveGroupInfoLevel.INFO, f"Connected to {place}")
    assert commands.database([place, "0"]) == connected == commands.database([])


def test_what_cannot_be_saved_leaves_what_was_there(tmp_path: Path) -> None:
    storage = ConstraintsStorage(str(tmp_path / "some.sqlite"))
    storage.add_constraints(constraints("low"))
    with sqlite3.connect(storage.path) as database:
        database.execute(
            'CREATE TRIGGER full BEFORE INSERT ON "T_moveit_constraints@constraints" '
            "BEGIN SELECT RAISE(ABORT, 'disk full'); END"
        )
    with pytest.raises(MoveItCommanderException, match="disk full"):
        storage.add_constraints(constraints("low", 0.5))
    assert storage.get_constraints("low") == constraints("low")
