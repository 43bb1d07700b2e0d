# SPDX-License-Identifier: BSD-3-Clause
"""Waits at the start have one configurable limit, and say every ten seconds what is missing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from modular_framework_ros import declared_parameters, start_up
from modular_framework_ros.start_up import start_timeout, wait_for_start


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A node whose wall time passes while it sleeps; its parameters, warnings and clock."""
    state = SimpleNamespace(parameters={}, warnings=[], errors=[], now_s=1000.0)

    def sleep(period_s: float) -> None:
        state.now_s += period_s

    monkeypatch.setattr(start_up, "time", SimpleNamespace(monotonic=lambda: state.now_s, sleep=sleep))
    monkeypatch.setattr(
        start_up,
        "rospy",
        SimpleNamespace(
            is_shutdown=lambda: False,
            logwarn=lambda text, *values: state.warnings.append(text % values),
        ),
    )
    monkeypatch.setattr(declared_parameters.rospy, "get_param", state.parameters.get)
    monkeypatch.setattr(
        declared_parameters.rospy, "logerr_throttle_identical", lambda period_s, text: state.errors.append(text)
    )
    return state


def test_a_node_that_comes_late_is_waited_for_and_named_every_ten_seconds(node: Any) -> None:
    assert wait_for_start(lambda: node.now_s > 1095.0, "service '/get_planning_scene'")
    assert len(node.warnings) == 9
    assert node.warnings[0] == "still waiting for service '/get_planning_scene' after 10 s (of 300 s at most)"


def test_the_wait_ends_at_the_limit_that_is_configured(node: Any) -> None:
    node.parameters["/start_timeout"] = 25
    assert not wait_for_start(lambda: False, lambda: "the joints ['a']")
    assert node.now_s == pytest.approx(1025.0, abs=0.1)
    assert [warning.split(" after")[0] for warning in node.warnings] == ["still waiting for the joints ['a']"] * 2


@pytest.mark.parametrize("value", [0, -1.0, "long", True, float("nan"), float("inf")])
def test_a_limit_without_sense_is_named_and_replaced(node: Any, value: object) -> None:
    node.parameters["/start_timeout"] = value
    assert start_timeout() == 300.0
    assert "/start_timeout" in node.errors[0] and "allowed: a number, above 0" in node.errors[0]
