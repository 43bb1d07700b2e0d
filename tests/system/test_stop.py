# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C while the simulated arm moves and while it stands: the task ends within a second, the arm rests."""

from __future__ import annotations

import pytest

from modular_framework_testing.picks.stop_moment import AT_REST_RAD_S, stop_a_pick


@pytest.mark.parametrize(
    ("after", "moment_s", "moves"), [("to 'MovePregrasp'", 0.3, True), ("first state running", 0.2, False)]
)
def test_ctrl_c_stops_task_arm_and_processes(after: str, moment_s: float, moves: bool) -> None:
    stop = stop_a_pick(moment_s, after, in_motion=moves)
    assert stop is not None
    assert stop.faults() == [], stop
    assert (stop.speed > AT_REST_RAD_S) == moves, stop
