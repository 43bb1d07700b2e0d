# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the interpreter and of the C library for a process in which several plans run beside short requests."""

from __future__ import annotations

import ctypes
import sys

SWITCH_INTERVAL_S = 0.0005
M_ARENA_MAX = -8  # glibc's name and number of mallopt's parameter
ARENAS = 2


def prepare() -> None:
    """Reduces waits between threads; to be called before the process starts threads.

    A thread that wakes up for a message waits for the interpreter behind every plan in turn, at Python's default up to
    5 ms each and several times a message: a change of the scene beside eight plans would take a third of a second.

    glibc gives each thread that finds the others busy an arena of its own, up to eight a core, and what a plan has
    freed in one is of no use to a thread with another. Other C libraries are left as they are.
    """
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_ARENA_MAX, ARENAS)
