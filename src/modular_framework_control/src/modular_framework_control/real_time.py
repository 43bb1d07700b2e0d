# SPDX-License-Identifier: BSD-3-Clause
"""Asks the operating system to let the control loop run on time, where it permits that.

What Python itself does against a steady loop is made small too: another thread gives the interpreter up after a
fraction of a cycle, and what exists when the loop begins is never looked through for garbage again.
"""
from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import resource
import sys

PRIORITY = 80
HELPER_PRIORITY = 10
_SWITCH_INTERVAL_S = 2e-4
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4


def prepare_interpreter() -> None:
    """Keep other threads and the garbage collector from holding the loop up; call it when everything is set up."""
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()


def run_in_real_time(priority: int = PRIORITY) -> list[str]:
    """Run this process before ordinary ones, the calling thread before its others (SCHED_FIFO); keep its memory in RAM.

    The other threads go first too, as the loop waits while one of them holds Python's interpreter: an ordinary process
    that takes the processor from that one would hold up the loop.

    Args:
        priority: of the calling thread, 1 to 99; what the control loop needs is less urgent than the loop itself.

    Returns:
        What was not permitted and why; nothing when all was.
    """
    refused = []
    try:
        for thread in os.listdir("/proc/self/task"):
            with contextlib.suppress(ProcessLookupError):   # it has ended meanwhile
                os.sched_setscheduler(int(thread), os.SCHED_FIFO, os.sched_param(HELPER_PRIORITY))
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        refused.append(f"real-time scheduling ({error.strerror}; allow it with an rtprio of {PRIORITY} in limits.conf, "
                       f"or docker run --cap-add SYS_NICE --ulimit rtprio={PRIORITY})")
    reason = _lock_memory()
    if reason:
        refused.append(f"locking of memory ({reason}; allow it with memlock unlimited in limits.conf, "
                       "or docker run --ulimit memlock=-1)")
    return refused


def _lock_memory() -> str:
    """Keep the memory in use, now and later, in RAM; returns why that is not permitted, or ""."""
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        return f"at most {limit // 1024} kB may be locked"
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0:
        return os.strerror(ctypes.get_errno())
    return ""
