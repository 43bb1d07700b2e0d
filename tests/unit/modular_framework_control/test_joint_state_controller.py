# SPDX-License-Identifier: BSD-3-Clause
"""Which joints the state controller reports, in which order, and what it refuses."""
from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_control.controller import ControllerError


def states_of(make_loop: Callable[..., Any], **parameters: Any) -> Any:
    """The first report of hardware with joints c, a, b."""
    loop = make_loop({"hw": {"joints": ["c", "a", "b"], "initial_positions": {"a": 0.25, "c": -0.5}},
                      "states": {"type": "joint_state_controller/JointStateController", **parameters}})
    loop.manager.load_controller("states")
    seen: list[Any] = []
    loop.controllers["states"].on_state = seen.append
    assert loop.switch(["states"], []) is None
    loop.step()
    return seen[0]


def test_all_joints_are_reported_by_name_unless_some_are_listed(make_loop: Callable[..., Any]) -> None:
    assert states_of(make_loop).names == ["a", "b", "c"]
    some = states_of(make_loop, joints=["c", "a"], extra_joints=[{"name": "wheel", "velocity": 2, "effort": 3.0}])
    assert (some.names, some.positions) == (["c", "a", "wheel"], [-0.5, 0.25, 0.0])
    assert (some.velocities[2], some.efforts[2]) == (2.0, 3.0)


@pytest.mark.parametrize(("parameters", "words"), [
    ({"joints": ["a", "z"]}, "no joint 'z'; it has: a, b, c"), ({"joints": []}, "/states/joints"),
    ({"extra_joints": [{"name": "w"}, {"name": "w"}]}, "entry 1 names joint 'w' again"),
    ({"extra_joints": [{"name": ""}]}, "entry 0 is {'name': ''}; expected a mapping with a name"),
    ({"extra_joints": [{"name": "w", "position": math.nan}]}, r"\[nan, 0.0, 0.0\]; expected finite numbers"),
    ({"extra_joints": [{"name": "w", "effort": True}]}, "expected finite numbers"),
])
def test_what_cannot_be_reported_is_named(make_loop: Callable[..., Any], parameters: Any, words: str) -> None:
    with pytest.raises(ControllerError, match=words):
        states_of(make_loop, **parameters)
