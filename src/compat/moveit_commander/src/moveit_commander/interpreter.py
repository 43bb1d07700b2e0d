# SPDX-License-Identifier: BSD-3-Clause
"""Text commands for terminals and command files: MoveGroupCommandInterpreter."""

from __future__ import annotations

import os.path
from collections.abc import Callable
from pathlib import Path

from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_commands import (
    ASSIGNMENTS,
    COMMANDS,
    DIRECTIONS,
    OK,
    Answer,
    GroupCommands,
    MoveGroupInfoLevel,
    Words,
    info,
    vector,
)
from moveit_commander.move_group import MoveGroupCommander
from moveit_commander.planning_scene_interface import PlanningSceneInterface
from moveit_commander.robot import RobotCommander

GENERAL = {
    "use": ("use [<group>|previous]", "command another group, or list the groups in use"),
    "trace": ("trace [on|off]", "show the lines of a file as they are executed"),
    "load": ("load [<file>]", "execute the commands of a file"),
    "save": ("save [<file>]", "write groups and remembered joint values as commands"),
    "help": ("help", "this list"),
}
ALIASES = {"which": "id", "groups": "use"}
FOLDER = Path("cmd")  # its files are commands by name


class MoveGroupCommandInterpreter:
    """Executes command lines for one group at a time."""

    DEFAULT_FILENAME = "move_group.cfg"
    GO_DIRS = DIRECTIONS

    def __init__(self) -> None:
        self._robot = RobotCommander()
        self._scene = PlanningSceneInterface()
        self._groups: dict[str, GroupCommands] = {}
        self._name = ""
        self._previous = ""
        self._traces = False

    def get_active_group(self) -> MoveGroupCommander | None:
        """Returns the active group, if any."""
        return self._groups[self._name].group if self._name else None

    def get_loaded_groups(self) -> list[str]:
        """Returns the groups used so far."""
        return list(self._groups)

    def execute(self, cmd: str) -> Answer:
        """Executes a line; returns a MoveGroupInfoLevel and a text, also for an invalid line."""
        line = self.resolve_command_alias(cmd.strip())
        if not line:
            return OK
        answer = self.execute_generic_command(line)
        if answer is not None:
            return answer
        group = self.get_active_group()
        if group is None:
            return MoveGroupInfoLevel.WARN, (
                "No group is active yet; enter: use <group>, with one of "
                f"{', '.join(self._robot.get_group_names())}\n\n{self.get_help()}"
            )
        return self.execute_group_command(group, line)

    def resolve_command_alias(self, cmdorig: str) -> str:
        """Returns the command of an alias."""
        return ALIASES.get(cmdorig.lower(), cmdorig)

    def execute_generic_command(self, cmd: str) -> Answer | None:
        """Executes a command that is independent of groups; returns None for other commands."""
        try:
            return self._execute_generic(cmd)
        except MoveItCommanderException as error:
            return MoveGroupInfoLevel.WARN, str(error)

    def execute_group_command(self, g: MoveGroupCommander, cmdorig: str) -> Answer:
        """Executes a command of a group."""
        try:
            return self._commands_of(g).execute(cmdorig)
        except MoveItCommanderException as error:
            return MoveGroupInfoLevel.WARN, str(error)

    def _execute_generic(self, line: str) -> Answer | None:
        if os.path.isfile(f"{FOLDER}/{line}"):  # tolerates overlong lines and leading slashes
            return self._load([f"{FOLDER}/{line}"])
        words = line.split()
        first = words[0].lower()
        general: dict[str, Callable[[Words], Answer]] = {
            "use": self._use,
            "trace": self._trace,
            "load": self._load,
            "save": self._save,
            "help": lambda _: info(self.get_help()),
        }
        if first in general and len(words) <= (1 if first == "help" else 2):
            return general[first](words[1:])
        if first in general and "=" not in line:
            return MoveGroupInfoLevel.WARN, f"'{line}': this command is used as: {GENERAL[first][0]}"
        return None

    def _commands_of(self, group: MoveGroupCommander) -> GroupCommands:
        for commands in self._groups.values():
            if commands.group is group:
                return commands
        return GroupCommands(group, self._scene, self._robot.get_root_link())

    def _use(self, words: Words) -> Answer:
        if not words:
            return info("\n".join(self._groups))
        name = self._previous if words[0] == "previous" else words[0]
        if name and name not in self._groups:
            self._groups[name] = GroupCommands(MoveGroupCommander(name), self._scene, self._robot.get_root_link())
        if name:
            self._previous, self._name = self._name, name
        return OK

    def _trace(self, words: Words) -> Answer:
        if not words:
            return info(f"trace is {'on' if self._traces else 'off'}")
        if words[0].lower() not in ("on", "off"):
            raise MoveItCommanderException(f"trace {words[0]}: on or off is allowed")
        self._traces = words[0].lower() == "on"
        return OK

    def _load(self, words: Words) -> Answer:
        """Executes the lines of a file until the first invalid or failed line."""
        path = Path(words[0] if words else self.DEFAULT_FILENAME)
        in_folder = f"{FOLDER}/{path}"
        if not os.path.isfile(path) and os.path.isfile(in_folder):
            path = Path(in_folder)
        try:
            lines = path.read_text().splitlines()
        except (OSError, ValueError) as error:  # not a text file, or an invalid file name
            raise MoveItCommanderException(f"Unable to load {path}: {error}") from error
        for number, line in enumerate(lines, 1):
            command = line.partition("#")[0].strip()
            if self._traces:
                print(f"{path}:{number}:  {line}")
            level, text = self.execute(command)
            if level in (MoveGroupInfoLevel.FAIL, MoveGroupInfoLevel.WARN):
                return level, f"Error at {path}:{number}:  {line}\n{text}"
        return OK

    def _save(self, words: Words) -> Answer:
        path = Path(words[0] if words else self.DEFAULT_FILENAME)
        lines = []
        for name, commands in self._groups.items():
            lines.append(f"use {name}")
            for key, values in commands.group.get_remembered_joint_values().items():
                lines.append(f"{key} = {vector(values)}")
            if (database := commands.database_path()) is not None:
                lines.append(f"database {database}")
        try:
            path.write_text("".join(f"{line}\n" for line in lines))
        except (OSError, ValueError) as error:
            raise MoveItCommanderException(f"Unable to save {path}: {error}") from error
        return OK

    def get_help(self) -> str:
        """Returns all commands, one per line."""
        rows = [
            *GENERAL.values(),
            *((item.usage, item.text) for item in dict.fromkeys(COMMANDS.values())),
            *ASSIGNMENTS,
        ]
        return "\n".join(["Known commands:", *(f"  {usage:<32} {text}" for usage, text in rows)])

    def get_keywords(self) -> dict[str, list[str]]:
        """Returns the possible arguments of each command, for completion."""
        group = self.get_active_group()
        known = list(group.get_remembered_joint_values()) if group else []
        states = list(group.get_named_targets()) if group else []
        more = {
            "go": [*DIRECTIONS, "random", *states],
            "plan": ["random", *states],
            "use": self._robot.get_group_names(),
            "record": known,
            "show": known,
            "delete": known,
            "constrain": group.get_known_constraints() if group else [],
            "allow": ["replanning", "looking"],
            "trace": ["on", "off"],
        }
        return {name: more.get(name, []) for name in (*GENERAL, *COMMANDS)}
