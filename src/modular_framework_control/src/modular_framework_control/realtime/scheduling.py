# SPDX-License-Identifier: BSD-3-Clause
"""Real-time scheduling of the control loop, as far as the operating system permits.

Jitter from Python itself is reduced too: other threads release the interpreter after a fraction of a cycle, and the
loop keeps the interpreter during its cycle. The garbage collector ignores all objects that exist when the loop starts
or that survive two collections.
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
OTHERS_PRIORITY = 70
"""Priority of the other threads of the loop's process."""
_SWITCH_INTERVAL_S = 2e-4
_CYCLE_SWITCH_INTERVAL_S = 2e-3  # longer than the work of a cycle
_NO_FULL_COLLECTIONS = 2**31 - 1
LATENCY_DEVICE = "/dev/cpu_dma_latency"
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4


def prepare_interpreter() -> None:
    """Reduces delays by other threads and the garbage collector; call after set-up."""
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    gc.set_threshold(*gc.get_threshold()[:2], _NO_FULL_COLLECTIONS)


@contextlib.contextmanager
def hold_interpreter() -> Iterator[None]:
    """Lets the calling thread keep the interpreter during a cycle, unless the thread waits.

    A waiting thread requests the interpreter after the current switch interval. Without this context, a cycle beside a
    busy thread would switch the interpreter many times.
    """
    sys.setswitchinterval(_CYCLE_SWITCH_INTERVAL_S)
    try:
        yield
    finally:
        sys.setswitchinterval(_SWITCH_INTERVAL_S)


def run_in_real_time(priority: int = PRIORITY, others_priority: int = OTHERS_PRIORITY) -> list[str]:
    """Gives all threads of this process real-time priority (SCHED_FIFO), and locks its memory in RAM.

    Other threads get a real-time priority too, because the loop must wait for a thread that holds Python's interpreter,
    and other processes could preempt this thread.

    Args:
        priority: Priority of the calling thread, 1 to 99; helper processes of the control loop should use lower
            priorities than the loop's process.
        others_priority: Priority of the other threads, 1 to 99.

    Returns:
        Refused requests with reasons; empty if all were permitted.
    """
    refused = []
    caller = threading.get_native_id()
    try:
        os.sched_setscheduler(caller, os.SCHED_FIFO, os.sched_param(priority))
        for thread in set(map(int, os.listdir("/proc/self/task"))) - {caller}:
            with contextlib.suppress(ProcessLookupError):  # the thread has ended
                os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(others_priority))
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
    """Restores ordinary scheduling of all threads; call while the robot is at rest, as shutdown takes long."""
    for thread in map(int, os.listdir("/proc/self/task")):
        with contextlib.suppress(OSError):  # the thread has ended
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))


def keep_processors_awake(latency_device: str = LATENCY_DEVICE) -> list[str]:
    """Disables deep sleep states of idle processors until this process ends, at the cost of power.

    Args:
        latency_device: The kernel's device for latency requests.

    Returns:
        Refused requests with reasons; empty if all were permitted.
    """
    try:
        device = os.open(latency_device, os.O_WRONLY | os.O_CLOEXEC)  # the request is active while the device is open
        os.write(device, (0).to_bytes(4, sys.byteorder))
    except OSError as error:
        return [
            f"idle processors kept awake ({latency_device}: {error.strerror}; allow write access with "
            f"a udev rule, or docker run --device {latency_device})"
        ]
    return []


def _lock_memory() -> str:
    """Locks current and future memory in RAM; returns the reason of a refusal, or ""."""
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        return f"at most {limit // 1024} kB may be locked"
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0:
        return os.strerror(ctypes.get_errno())
    return ""
