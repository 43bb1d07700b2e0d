# SPDX-License-Identifier: BSD-3-Clause
"""The test of a state, to begin with: run it with ``./install.sh exec python3 -m pytest <this file>``."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import smach

sys.path.insert(0, str(Path(__file__).parent))
from my_state import MyState  # noqa: E402


def test_it_succeeds_and_tells_the_side() -> None:
    """The positive outcome, and what it leaves in the userdata."""
    userdata = smach.UserData()
    assert MyState("left", output_keys=("chosen_side",)).execute(userdata) == "success"
    assert userdata.chosen_side == "left"


def test_it_fails_with_a_reason() -> None:
    """The negative outcome has a reason a person can act on."""
    state = MyState("right", timeout=0.1)
    assert state.execute(smach.UserData()) == "fail"
    assert state.reason == "nothing was seen on the right within 0.1 s"


def test_it_stops_when_asked() -> None:
    """A request to stop ends the wait."""
    state = MyState("right", timeout=60.0)
    threading.Timer(0.1, state.request_preempt).start()
    assert state.execute(smach.UserData()) == "fail"
    assert state.reason == "stopped on request"
