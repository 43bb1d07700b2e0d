# SPDX-License-Identifier: BSD-3-Clause
"""Turns come at their rate, also where sums of periods are not exact."""

from __future__ import annotations

import pytest

from modular_framework_control.realtime.schedule import Schedule


@pytest.mark.parametrize(("rate", "step_s"), [(100.0, 0.002), (50.0, 0.001), (30.0, 1.0 / 240.0)])
def test_turns_are_taken_in_the_first_cycle_that_is_due(rate: float, step_s: float) -> None:
    schedule = Schedule(rate)
    schedule.start(0.0)
    steps = round(1.0 / rate / step_s)
    taken = [number for number in range(60 * round(rate) * steps) if schedule.take_if_due(number * step_s)]
    assert taken == list(range(0, 60 * round(rate) * steps, steps))


def test_turns_that_were_missed_are_not_made_up_for() -> None:
    schedule = Schedule(10.0)
    schedule.start(0.0)
    assert [schedule.take_if_due(time_s) for time_s in (0.0, 0.55, 0.56, 0.64, 0.65)] == [
        True,
        True,
        False,
        False,
        True,
    ]
