# SPDX-License-Identifier: BSD-3-Clause
"""The witnesses of `benchmarks/control_loop` report when processors were away, and which cycles could not run."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from processor_witness import Witnesses, cycles_without_processor, longest_s  # noqa: E402

PERIOD_S = 0.008


def test_cycles_are_lost_only_while_a_processor_is_away_for_a_period() -> None:
    assert cycles_without_processor([(1.0, 1.02), (3.0, 3.1)], PERIOD_S) == 2 + 12
    assert cycles_without_processor([], PERIOD_S) == 0
    assert cycles_without_processor([(1.0, 1.007)], PERIOD_S) == 0
    assert cycles_without_processor([(1.0, 1.006), (1.007, 1.013)], PERIOD_S) == 0


def test_a_processor_that_is_taken_away_is_noticed(preemption_permitted: bool) -> None:
    witnesses = Witnesses()
    if not preemption_permitted:
        assert witnesses.taken() is None
        return
    last = max(os.sched_getaffinity(0))
    thief = os.fork()
    if thief == 0:  # as urgent as a witness, so it keeps the processor from one that sleeps
        os.sched_setaffinity(0, {last})
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
        end_s = time.monotonic() + 0.1
        while time.monotonic() < end_s:
            pass
        os._exit(0)
    os.waitpid(thief, 0)
    taken = witnesses.taken()
    assert taken is not None and len(taken) == len(os.sched_getaffinity(0))
    assert 0.09 < longest_s(taken[-1]) < 5.0
