# SPDX-License-Identifier: BSD-3-Clause
"""Asks the operating system to let the control loop run on time, where it permits that.

The jitter that Python itself causes is reduced too: another thread releases the interpreter to the loop after a
fraction of a cycle, and the loop keeps the interpreter during its cycle. The garbage collector ignores all objects that
exist when the loop begins, or that it has seen twice.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import resource
import sys
import threading
from collections.abc import Iterator

PRIORITY = 80
OTHERS_BELOW = 10
"""By how much the priority of the other threads of a process is lower than that of the loop."""
_SWITCH_INTERVAL_S = 2e-4
_CYCLE_SWITCH_INTERVAL_S = 2e-3  # longer than the work of a cycle
_NO_FULL_COLLECTIONS = 2**31 - 1
LATENCY_DEVICE = "/dev/cpu_dma_latency"
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4


def prepare_interpreter() -> None:
    """Keeps other threads and the garbage collector from delaying the loop; call it after set-up."""
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    gc.set_threshold(*gc.get_threshold()[:2], _NO_FULL_COLLECTIONS)


@contextlib.contextmanager
def keeping_the_interpreter() -> Iterator[None]:
    """Lets the calling thread keep the interpreter during a cycle, unless it waits for something itself.

    A thread that comes to wait for the interpreter asks for it only after the switch interval at that time. Without
    this a cycle beside a busy thread hands the interpreter to and fro many times.
    """
    sys.setswitchinterval(_CYCLE_SWITCH_INTERVAL_S)
    try:
        yield
    finally:
        sys.setswitchinterval(_SWITCH_INTERVAL_S)


def run_in_real_time(priority: int = PRIORITY) -> list[str]:
    """Gives this process real-time priority, the calling thread the highest (SCHED_FIFO), and locks its memory in RAM.

    The other threads get a real-time priority too, because the loop waits while one of them holds Python's interpreter:
    a process that takes the processor from that thread would delay the loop.

    Args:
        priority: of the calling thread, above OTHERS_BELOW and up to 99; a process that serves the control loop takes
            less than the loop's other threads have.

    Returns:
        What was not permitted and why; nothing when all was.
    """
    refused = []
    caller = threading.get_native_id()
    try:
        os.sched_setscheduler(caller, os.SCHED_FIFO, os.sched_param(priority))
        for thread in set(map(int, os.listdir("/proc/self/task"))) - {caller}:
            with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
                os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority - OTHERS_BELOW))
    except OSError as error:
        refused.append(
            f"real-time scheduling ({error.strerror}; allow it with an rtprio of {PRIORITY} in limits.conf, "
            f"or docker run --cap-add SYS_NICE --ulimit rtprio={PRIORITY})"
        )
    reason = _lock_memory()
    if reason:
        refused.append(
            f"locking of memory ({reason}; allow it with memlock unlimited in limits.conf, "
            "or docker run --ulimit memlock=-1)"
        )
    return refused


def leave_real_time() -> None:
    """Gives all threads of this process ordinary scheduling, once nothing moves: to end takes much processor time."""
    for thread in map(int, os.listdir("/proc/self/task")):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))


def keep_processors_awake(latency_device: str = LATENCY_DEVICE) -> list[str]:
    """Keeps idle processors from sleep states that take long to leave, while this process lives (it costs power).

    Args:
        latency_device: the kernel's device for such requests.

    Returns:
        What was not permitted and why; nothing when all was.
    """
    try:
        device = os.open(latency_device, os.O_WRONLY | os.O_CLOEXEC)  # the request holds as long as it is open
        os.write(device, (0).to_bytes(4, sys.byteorder))
    except OSError as error:
        return [
            f"idle processors kept awake ({latency_device}: {error.strerror}; allow to write it with a rule of "
            f"udev, or docker run --device {latency_device})"
        ]
    return []


def _lock_memory() -> str:
    """Keeps the memory in use, now and later, in RAM; returns why that is not permitted, or ""."""
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        return f"at most {limit // 1024} kB may be locked"
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0:
        return os.strerror(ctypes.get_errno())
    return ""
