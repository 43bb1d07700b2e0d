# SPDX-License-Identifier: BSD-3-Clause
"""Command line: reads and completes commands, and prints coloured answers."""

from __future__ import annotations

import argparse
import readline
import sys
from collections.abc import Callable, Mapping, Sequence

import rospy

from moveit_commander.exception import MoveItCommanderException
from moveit_commander.group_commands import MoveGroupInfoLevel
from moveit_commander.interpreter import MoveGroupCommandInterpreter
from moveit_commander.roscpp_initializer import roscpp_initialize, roscpp_shutdown

COLOURS = {
    MoveGroupInfoLevel.FAIL: "\033[91m",
    MoveGroupInfoLevel.WARN: "\033[93m",
    MoveGroupInfoLevel.SUCCESS: "\033[92m",
    MoveGroupInfoLevel.DEBUG: "\033[94m",
    MoveGroupInfoLevel.INFO: "",
}
RESET_COLOUR = "\033[0m"
QUIT_WORDS = ("q", "quit", "exit")


def completions(keywords: Mapping[str, Sequence[str]], line: str, text: str) -> list[str]:
    """Returns the completions of the last word of a line.

    Args:
        keywords: Possible arguments of each command.
        line: Line up to the cursor.
        text: Last word of the line.
    """
    before = line[: len(line) - len(text)].split()
    words = keywords if not before else keywords.get(before[0].lower(), ())
    return sorted(word + " " for word in words if word.startswith(text))


def _completer(interpreter: MoveGroupCommandInterpreter) -> Callable[[str, int], str | None]:
    def complete(text: str, index: int) -> str | None:
        found = completions(interpreter.get_keywords() | {"quit": []}, readline.get_line_buffer(), text)
        return found[index] if index < len(found) else None

    return complete


def _show(level: int, text: str, colours: bool) -> None:
    print(f"{COLOURS[level]}{text}{RESET_COLOUR}" if colours and COLOURS[level] else text, flush=True)


def _execute_lines(interpreter: MoveGroupCommandInterpreter) -> int:
    """Executes lines until the end of input; returns the number of failed lines."""
    colours, failures = sys.stdout.isatty(), 0
    readline.set_completer(_completer(interpreter))
    readline.parse_and_bind("tab: complete")
    while not rospy.is_shutdown():
        group = interpreter.get_active_group()
        try:
            line = input(f"{group.get_name() if group else ''}> " if sys.stdin.isatty() else "").strip()
        except (EOFError, KeyboardInterrupt):
            break
        if line.lower() in QUIT_WORDS:
            break
        if line:
            level, text = interpreter.execute(line)
            failures += level in (MoveGroupInfoLevel.FAIL, MoveGroupInfoLevel.WARN)
            _show(level, text, colours)
    return failures


def main() -> int:
    """Runs the command line; returns 0 if all commands succeeded, 1 after a failed command, 2 without move_group."""
    roscpp_initialize(sys.argv)
    rospy.init_node("move_group_interface_cmdline", anonymous=True, disable_signals=True)
    parser = argparse.ArgumentParser(description="Commands move_group from a terminal.")
    parser.add_argument("-i", "--interactive", action="store_true", help="read commands from the terminal (default)")
    parser.add_argument("group_name", nargs="?", default="", help="planning group to command first")
    arguments = parser.parse_args(rospy.myargv(sys.argv)[1:])
    try:
        interpreter = MoveGroupCommandInterpreter()
        if arguments.group_name:
            level, text = interpreter.execute(f"use {arguments.group_name}")
            if level == MoveGroupInfoLevel.WARN:
                raise MoveItCommanderException(text)
    except MoveItCommanderException as error:
        print(error, file=sys.stderr)
        return 2
    if sys.stdin.isatty():
        print("Type help to see all commands, quit to leave.")
    failures = _execute_lines(interpreter)
    roscpp_shutdown()
    return 1 if failures else 0
