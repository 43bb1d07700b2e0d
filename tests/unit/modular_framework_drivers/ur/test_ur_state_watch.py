# SPDX-License-Identifier: BSD-3-Clause
"""Detection of a silent arm, and of implausible states."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_drivers.ur import rtde_process
from modular_framework_drivers.ur.arm_messages import ArmState
from modular_framework_drivers.ur.state_watch import ModeConfirmation, SilenceWatch, is_plausible

SIX = (0.1,) * 6
STATE = ArmState(
    received_s=100.0,
    timestamp_s=5.0,
    positions=SIX,
    velocities=SIX,
    currents=SIX,
    wrench=SIX,
    speed_fraction=1.0,
    speed_scaling=1.0,
    robot_mode=7,
    safety_mode=1,
    runtime_state=2,
)


def next_state(**changes: object) -> ArmState:
    return replace(STATE, **{"received_s": 100.008, "timestamp_s": 5.008, **changes})  # type: ignore[arg-type]


class ReplacedState:
    """What ur-rtde holds of an arm; the next state arrives after the getter `arrives_after` was called."""

    def __init__(self, arrives_after: str) -> None:
        self._arrives_after, self._states = arrives_after, [STATE, next_state(safety_mode=3)]

    def __getattr__(self, name: str) -> Callable[[], object]:
        fields = {
            "getTimestamp": "timestamp_s",
            "getActualQ": "positions",
            "getActualQd": "velocities",
            "getActualCurrent": "currents",
            "getActualTCPForce": "wrench",
            "getTargetSpeedFraction": "speed_fraction",
            "getSpeedScaling": "speed_scaling",
            "getRobotMode": "robot_mode",
            "getSafetyMode": "safety_mode",
            "getRuntimeState": "runtime_state",
        }
        value = getattr(self._states[0], fields[name])
        if name == self._arrives_after:
            self._states = self._states[-1:]
        return lambda: value


@pytest.mark.parametrize("getter", ["getTimestamp", "getRobotMode", "getSafetyMode"])
def test_a_state_that_is_replaced_while_it_is_read_is_read_again(getter: str) -> None:
    arm = ReplacedState(getter)
    assert rtde_process.read_new_state(arm, 100.0, 0.0) is None
    assert rtde_process.read_new_state(arm, 100.008, 0.0) == next_state(safety_mode=3)


def test_a_state_is_read_once() -> None:
    arm = ReplacedState("")
    assert rtde_process.read_new_state(arm, 100.0, 0.0) == STATE
    assert rtde_process.read_new_state(arm, 100.0, STATE.timestamp_s) is None


def test_silence_is_the_time_since_something_was_heard_for_who_listens_all_the_time() -> None:
    watch, now_s = SilenceWatch(0.0), 0.0
    for _ in range(120):
        now_s += 0.001
        silent_s = watch.update(now_s, heard=False)
    assert silent_s == pytest.approx(0.12)
    assert watch.update(now_s + 0.001, heard=True) == 0.0


@given(st.lists(st.floats(0.0, 30.0), max_size=5))
def test_time_in_which_nobody_listened_is_no_silence(absences: list[float]) -> None:
    watch, now_s = SilenceWatch(0.0), 0.0
    for absence_s in absences:
        now_s += absence_s
        silent_s = watch.update(now_s, heard=False)
        assert silent_s <= 0.02 * len(absences)


def test_a_state_a_cycle_later_follows() -> None:
    assert is_plausible(STATE, None)
    assert is_plausible(next_state(positions=(0.12,) * 6), STATE)


def test_a_joint_that_turns_without_end_has_turned_often() -> None:
    assert is_plausible(next_state(positions=(*SIX[1:], 50.0)), None)
    assert is_plausible(next_state(positions=(*SIX[1:], 50.02)), replace(STATE, positions=(*SIX[1:], 50.0)))


@pytest.mark.parametrize(
    "changes",
    [
        {"timestamp_s": math.nan},
        {"timestamp_s": 4.9},
        {"positions": (math.nan, *SIX[1:])},
        {"positions": (101.0, *SIX[1:])},
        {"positions": (0.3, *SIX[1:])},
        {"timestamp_s": 5.008 + 2.0**20},
        {"velocities": (1e200, *SIX[1:])},
        {"currents": (math.nan, *SIX[1:])},
        {"wrench": (*SIX[1:], 1e9)},
        {"safety_mode": 1048577},
        {"robot_mode": 7 - 2**31},
        {"runtime_state": 2 + 2**24},
    ],
)
def test_garbage_does_not_follow(changes: dict[str, object]) -> None:
    assert not is_plausible(next_state(**changes), STATE)


def test_only_two_successive_states_change_the_modes() -> None:
    modes = ModeConfirmation()
    running, idle = (7, 1, 2), (5, 1, 2)
    assert [modes.confirm(each) for each in (running, running)] == [False, True]
    assert [modes.confirm(each) for each in (idle, running, idle, running)] == [False, True, False, True]
    assert [modes.confirm(each) for each in (idle, idle, idle)] == [False, True, True]


def test_states_with_damaged_data_between_them_do_not_change_the_modes() -> None:
    modes = ModeConfirmation()
    running, idle, damaged = (7, 1, 2), (5, 1, 2), None
    assert [modes.confirm(each) for each in (damaged, damaged, running, running)] == [False, False, False, True]
    assert [modes.confirm(each) for each in (idle, damaged, idle, damaged, running)] == [False] * 4 + [True]
    assert [modes.confirm(each) for each in (damaged, idle, idle)] == [False, False, True]
