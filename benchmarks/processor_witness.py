# SPDX-License-Identifier: BSD-3-Clause
"""Measures when processors are taken away.

The host of a virtual machine takes them, or work of the kernel that nothing may interrupt.

On each processor that may be used a process sleeps a millisecond at a time, as the most urgent of all. What wakes it
late was no other process: from when it was to wake until it did, its processor was away.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time

NAP_S = 0.001
LATE_S = 0.001
URGENT = 99

Spans = list[tuple[float, float]]


class Witnesses:
    """One witness a processor, from now until `taken` is asked for. It costs a percent or two of each."""

    def __init__(self) -> None:
        self._processes = [
            subprocess.Popen([sys.executable, __file__, str(processor)], stdout=subprocess.PIPE)
            for processor in sorted(os.sched_getaffinity(0))
        ]
        for process in self._processes:
            assert process.stdout is not None
            process.stdout.readline()  # it watches

    def taken(self) -> list[Spans] | None:
        """When each processor was away [s of the monotonic clock]; None if the system refuses the priority."""
        reports = []
        for process in self._processes:
            process.terminate()
            reports.append(json.loads(process.communicate()[0]))
        return None if None in reports else [[(begin_s, end_s) for begin_s, end_s in spans] for spans in reports]


def cycles_without_processor(spans: Spans, period_s: float) -> int:
    """Returns how many cycles of a loop a processor was away for, at most.

    This many a loop loses if one is due when the processor goes away; otherwise it may lose one less.

    Args:
        spans: when the processor was away [s].
        period_s: of the loop [s].
    """
    return sum(math.floor((end_s - begin_s) / period_s) for begin_s, end_s in spans)


def longest_s(spans: Spans) -> float:
    """Length of the longest span [s]."""
    return max((end_s - begin_s for begin_s, end_s in spans), default=0.0)


def watch(processor: int) -> Spans | None:
    """Watch one processor until SIGTERM, or until nobody is there to ask; None where that is not permitted."""
    ended, parent = False, os.getppid()

    def end(number: int, frame: object) -> None:
        nonlocal ended
        del number, frame
        ended = True

    signal.signal(signal.SIGTERM, end)
    try:
        os.sched_setaffinity(0, {processor})
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(URGENT))
        permitted = True
    except OSError:
        permitted = False
    print("watching", flush=True)
    spans, wake_s = [], time.monotonic()
    while not ended and os.getppid() == parent:
        time.sleep(NAP_S if permitted else 0.1)
        now_s = time.monotonic()
        if now_s - wake_s > LATE_S:
            spans.append((wake_s, now_s))
        wake_s = now_s + NAP_S
    return spans if permitted else None


if __name__ == "__main__":
    print(json.dumps(watch(int(sys.argv[1]))))
