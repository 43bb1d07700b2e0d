# SPDX-License-Identifier: BSD-3-Clause
"""What tests of every kind ask the machine."""

from __future__ import annotations

import os
import threading

import pytest

CONTROL_LOOP = 80
MOST_URGENT = 99


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
