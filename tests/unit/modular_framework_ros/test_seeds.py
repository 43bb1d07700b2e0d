# SPDX-License-Identifier: BSD-3-Clause
"""One parameter seeds a launch; each purpose gets random numbers of its own."""

from __future__ import annotations

from typing import Any

import pytest
from rospy.impl.paramserver import ParamServerCache

from modular_framework_ros import seeds


def with_parameter(monkeypatch: pytest.MonkeyPatch, value: Any) -> None:
    monkeypatch.setattr(seeds.rospy, "get_param_cached", lambda name, default: value)


@pytest.mark.parametrize("value", [None, "", {}])
def test_without_the_parameter_there_is_no_seed(monkeypatch: pytest.MonkeyPatch, value: Any) -> None:
    with_parameter(monkeypatch, value)
    assert seeds.seed_parameter() is None


def test_the_master_is_asked_once_and_tells_of_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    known, asked = ParamServerCache(), []

    def ask(name: str, default: Any) -> Any:  # as rospy.get_param_cached where the master knows no such parameter
        asked.append(name)
        known.set(name, {})
        return default

    monkeypatch.setattr(seeds, "get_param_server_cache", lambda: known)
    monkeypatch.setattr(seeds.rospy, "get_param_cached", ask)
    assert [seeds.seed_parameter() for _ in range(3)] == [None] * 3 and asked == ["/seed"]
    known.update("/seed", 7)
    assert seeds.seed_parameter() == 7
    known.update("/seed", {})
    assert seeds.seed_parameter() is None and asked == ["/seed"]


def test_zero_is_a_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    with_parameter(monkeypatch, 0)
    assert seeds.seed_parameter() == 0


@pytest.mark.parametrize("value", [-1, 1.5, True, "7", 2**31])
def test_what_is_no_seed_is_refused_with_what_is_allowed(monkeypatch: pytest.MonkeyPatch, value: Any) -> None:
    with_parameter(monkeypatch, value)
    with pytest.raises(seeds.SeedError, match=r"/seed.*at least 0 and at most 2147483647"):
        seeds.seed_parameter()


def test_seeds_of_purposes_differ_and_stay_the_same() -> None:
    asked = [(1, "planning", "x", 0), (1, "planning", "x", 1), (1, "grasps", "x", 0), (2, "planning", "x", 0)]
    found = [seeds.derived_seed(*item) for item in asked]
    assert len(set(found)) == len(found)
    assert found == [seeds.derived_seed(*item) for item in asked]
    assert all(0 <= seed <= seeds.MAX_SEED for seed in found)
