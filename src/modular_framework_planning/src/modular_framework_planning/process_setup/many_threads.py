# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the interpreter and the C library for a process that runs several plans and short requests in threads."""

from __future__ import annotations

import ctypes
import sys

SWITCH_INTERVAL_S = 0.0005
M_ARENA_MAX = -8  # parameter number and value for glibc's mallopt
ARENAS = 2


def prepare() -> None:
    """Reduces latency and memory of a process with many threads; call it before the process starts threads.

    A thread that handles a message competes with all planning threads for the interpreter lock. With Python's default
    switch interval of 5 ms, a scene update would take about 0.3 s beside eight plans.

    By default, glibc creates up to eight memory arenas per core. Memory freed in one arena is not available to threads
    that use a different arena. On other C libraries, the function does not change the allocator.
    """
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_ARENA_MAX, ARENAS)
