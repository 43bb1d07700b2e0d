# SPDX-License-Identifier: BSD-3-Clause
"""The workspace around a benchmark; every benchmark imports it before anything else.

- A benchmark that is started without the workspace starts again by `./install.sh exec`, with the workspace's
  interpreter and packages. With `--help` it sets nothing up: without a build it prints its docstring.
- SIGTERM ends a benchmark as an interrupt does, with one line. Programs that it started and that still run at its end
  are killed.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import signal
import sys
import uuid
from pathlib import Path
from types import TracebackType

ROOT = Path(__file__).resolve().parents[1]
MARK = "MODULAR_FRAMEWORK_BENCHMARK"
"""Variable of the environment that programs of a benchmark have; a benchmark within another one extends its value."""
_STARTS = "starts in the workspace"


def _enter() -> None:
    sourced = str(ROOT / "src") in os.environ.get("ROS_PACKAGE_PATH", "") and Path(sys.prefix) == ROOT / ".venv"
    outer = os.environ.get(MARK, "")
    if not sourced and not outer:
        os.environ[MARK] = _STARTS
        if {"-h", "--help"} & set(sys.argv[1:]):
            _help()
        os.execv(ROOT / "install.sh", ["install.sh", "exec", *sys.argv])
    os.environ[MARK] = ("" if outer == _STARTS else outer) + uuid.uuid4().hex
    if multiprocessing.current_process().name == "MainProcess":
        for number in (signal.SIGINT, signal.SIGTERM):  # a shell that starts it in the background ignores SIGINT
            signal.signal(number, signal.default_int_handler)
    else:  # a spawned process, which the benchmark ends
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.excepthook = _report
    os.register_at_fork(after_in_child=lambda: signal.signal(signal.SIGTERM, signal.SIG_DFL))
    atexit.register(_kill_what_is_left, os.getpid(), os.environ[MARK])


def _help() -> None:
    """Starts the benchmark again in the built workspace, or prints its docstring and ends it."""
    space = "install" if os.environ.get("INSTALL_SPACE") == "1" else "devel"
    if (ROOT / space / "setup.bash").exists():
        sourced = f'source "{ROOT}/install.sh" && source_workspace && exec "$@"'
        os.execv("/bin/bash", ["bash", "-c", sourced, "bash", *sys.argv])
    print(sys.modules["__main__"].__doc__)
    print("./install.sh sets the framework up; then --help lists the options.")
    sys.exit()


def _report(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Prints one line for an interrupt, and the traceback of any other exception."""
    if issubclass(kind, KeyboardInterrupt):
        print("interrupted", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


def _kill_what_is_left(benchmark: int, mark: str) -> None:
    """Kills the programs of a benchmark; does nothing in a process that was forked from it."""
    if os.getpid() == benchmark:
        for number in (signal.SIGINT, signal.SIGTERM):  # a second interrupt must not end this
            signal.signal(number, signal.SIG_IGN)
        from modular_framework_core.launching.launch_session import kill_processes_with

        kill_processes_with(MARK, mark, prefix=True)


if __name__ != "__main__":
    _enter()
