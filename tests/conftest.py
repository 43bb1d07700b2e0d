# SPDX-License-Identifier: BSD-3-Clause
"""What tests of every kind ask the machine."""

from __future__ import annotations

import os
import threading

import pytest


@pytest.fixture(scope="session")
def real_time_permitted() -> bool:
    """Whether the system lets a thread run in real time as urgently as a control loop; tried, not guessed."""
    granted: list[bool] = []

    def ask() -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(80))
        except OSError:
            return
        granted.append(True)

    asker = threading.Thread(target=ask)
    asker.start()
    asker.join()
    return bool(granted)
