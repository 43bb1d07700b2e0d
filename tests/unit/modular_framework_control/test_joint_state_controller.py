# SPDX-License-Identifier: BSD-3-Clause
"""Which joints the state controller reports, in which order, and what it refuses."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import ControllerError


def reports_of(make_loop: Callable[..., Any], **parameters: Any) -> list[Any]:
    """What is reported of hardware with joints c, a, b."""
    loop = make_loop(
        {
            "hw": {"joints": ["c", "a", "b"], "initial_positions": {"a": 0.25, "c": -0.5}},
            "states": {"type": "joint_state_controller/JointStateController", **parameters},
        }
    )
    loop.manager.load_controller("states")
    seen: list[Any] = []
    loop.controllers["states"].on_state = seen.append
    assert loop.switch(["states"], []) is None
    loop.step(10)
    return seen


def states_of(make_loop: Callable[..., Any], **parameters: Any) -> Any:
    """The first report."""
    return reports_of(make_loop, **parameters)[0]


def test_all_joints_are_reported_by_name_unless_some_are_listed(make_loop: Callable[..., Any]) -> None:
    assert states_of(make_loop).names == ["a", "b", "c"]
    some = states_of(make_loop, joints=["c", "a"], extra_joints=[{"name": "wheel", "velocity": 2, "effort": 3.0}])
    assert (some.names, some.positions) == (["c", "a", "wheel"], [-0.5, 0.25, 0.0])
    assert (some.velocities[2], some.efforts[2]) == (2.0, 3.0)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"joints": ["a", "z"]}, "no joint 'z'; it has: a, b, c"),
        ({"joints": []}, "/states/joints"),
    ],
)
def test_what_cannot_be_reported_is_named(make_loop: Callable[..., Any], parameters: Any, words: str) -> None:
    with pytest.raises(ControllerError, match=words):
        states_of(make_loop, **parameters)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ([{"name": "w"}, {"name": "w"}], "entry 1 is skipped: joint 'w' is repeated"),
        ([{"name": ""}, {"name": "w"}], "entry 0 is skipped: it is {'name': ''}; expected a mapping with a name"),
        (["elbow", {"name": "w"}], "entry 0 is skipped: it is 'elbow'"),
        (
            [{"name": "v", "position": math.nan}, {"name": "w"}],
            "joint 'v' are [nan, 0.0, 0.0]; expected finite numbers",
        ),
        ([{"name": "v", "effort": True}, {"name": "w"}], "expected finite numbers"),
    ],
)
def test_extra_joints_that_make_no_sense_are_skipped_with_an_error(
    make_loop: Callable[..., Any], extra: list[Any], words: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert states_of(make_loop, extra_joints=extra).names == ["a", "b", "c", "w"]
    assert "parameter /states/extra_joints: entry" in caplog.text and words in caplog.text
    assert [record.levelname for record in caplog.records if "joint_state" in record.name] == ["ERROR"]


def test_extra_joints_that_are_no_list_are_ignored_with_an_error(
    make_loop: Callable[..., Any], caplog: pytest.LogCaptureFixture
) -> None:
    assert states_of(make_loop, extra_joints={"name": "w"}).names == ["a", "b", "c"]
    assert "parameter /states/extra_joints is ignored: got {'name': 'w'}; expected a list" in caplog.text


def test_a_publish_rate_of_0_publishes_nothing(make_loop: Callable[..., Any]) -> None:
    assert reports_of(make_loop, publish_rate=0) == []
