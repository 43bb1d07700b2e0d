#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs a node of a method and remains the ancestor of all processes that the node starts.

    python3 method_node.py [--in-its-folder] EXECUTABLE [ARGUMENT ...]

A process whose parent ends becomes a child of this process (a child subreaper, see prctl(2)), whatever its Unix session
and environment. The processor time of a daemon is therefore counted, and the end of the stack ends the daemon.

The program ends as the node ends: after a node without fault it waits for the remaining processes, otherwise it kills
them.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
from pathlib import Path

COMMAND = (sys.executable, "-I", str(Path(__file__).resolve()))
"""Program and first arguments; independent of the Python environment of the node."""
IN_ITS_FOLDER_OPTION = "--in-its-folder"
"""Option that runs the node in the folder of its executable."""
PR_SET_CHILD_SUBREAPER = 36
"""Operation of prctl, see linux/prctl.h."""


def become_subreaper() -> None:
    """Makes this process the parent of all its descendants whose parent ends.

    Raises:
        OSError: The system refuses.
    """
    if ctypes.CDLL(None, use_errno=True).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl refuses a child subreaper; use Linux 3.4 or later")


def run(command: list[str]) -> int:
    """Runs a command and all processes that it starts.

    Args:
        command: Program and arguments.

    Returns:
        The exit code of the command, or the negative number of the signal that ended it.
    """
    node = os.posix_spawnp(command[0], command, os.environ)
    exit_code = 0
    with contextlib.suppress(ChildProcessError):  # no process remains
        while True:
            ended, status = os.wait()
            if ended == node and (exit_code := os.waitstatus_to_exitcode(status)):
                kill_children()
    return exit_code


def kill_children() -> None:
    """Kills all descendants; the children of a killed process become children of this process."""
    import psutil  # only here, so that a node starts without delay

    while children := psutil.Process().children():
        for child in children:
            child.kill()
        psutil.wait_procs(children)


def main(arguments: list[str]) -> int:
    """Runs a node; see the module."""
    become_subreaper()
    for number in (signal.SIGINT, signal.SIGTERM):  # roslaunch sends both to the process group, thus also to the node
        signal.signal(number, lambda *_: None)
    if arguments[0] == IN_ITS_FOLDER_OPTION:
        arguments = arguments[1:]
        os.chdir(Path(arguments[0]).parent)
    exit_code = run(arguments)
    if exit_code < 0:
        signal.signal(-exit_code, signal.SIG_DFL)
        os.kill(os.getpid(), -exit_code)
    return exit_code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
