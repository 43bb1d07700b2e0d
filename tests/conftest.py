# SPDX-License-Identifier: BSD-3-Clause
"""What tests of every kind ask the machine, and the selection of tests for the short run."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from full_only import LEAVE_OUT, read_full_only, split_items  # noqa: E402

CONTROL_LOOP = 80
MOST_URGENT = 99


@pytest.hookimpl(tryfirst=True)  # before a -k deselects tests
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves out the tests that only `./install.sh test full` runs, if tests/run requests this."""
    if LEAVE_OUT not in os.environ:
        return
    try:
        items[:], left_out = split_items(items, read_full_only())
    except ValueError as error:
        raise pytest.UsageError(str(error)) from None
    config.hook.pytest_deselected(items=left_out)


def pytest_collection_finish() -> None:
    """Keeps hypothesis from reading every imported module for constants, which takes each process up to 15 s."""
    if providers := sys.modules.get("hypothesis.internal.conjecture.providers"):
        providers.is_local_module_file = lambda path: False


@pytest.fixture(scope="session")
def real_time_permitted() -> bool:
    """Whether the system lets a thread run in real time as urgently as a control loop; tried, not guessed."""
    return _is_granted(CONTROL_LOOP)


@pytest.fixture(scope="session")
def preemption_permitted() -> bool:
    """Whether it lets a thread run more urgently than a control loop, so that it takes the processor from it."""
    return _is_granted(MOST_URGENT)


def _is_granted(priority: int) -> bool:
    granted: list[bool] = []

    def ask() -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        except OSError:
            return
        granted.append(True)

    asker = threading.Thread(target=ask)
    asker.start()
    asker.join()
    return bool(granted)
