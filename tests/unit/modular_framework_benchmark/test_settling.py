# SPDX-License-Identifier: BSD-3-Clause
"""An episode begins when its objects are at rest, or have not come to rest within 10 s."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from modular_framework_benchmark.episodes import ros_world
from modular_framework_benchmark.episodes.ros_world import moving_objects, wait_for_rest


def twist(linear: tuple[float, float, float], angular: tuple[float, float, float]) -> SimpleNamespace:
    vectors = (SimpleNamespace(x=x, y=y, z=z) for x, y, z in (linear, angular))
    return SimpleNamespace(**dict(zip(("linear", "angular"), vectors, strict=True)))


def test_objects_move_above_2_cm_or_a_fifth_of_a_radian_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    twists = {
        "cube": twist((0.01, -0.01, 0.01), (0.1, 0.1, 0.1)),
        "falling": twist((0.0, 0.015, -0.015), (0.0, 0.0, 0.0)),
        "rolling": twist((0.0, 0.0, 0.0), (0.15, 0.0, 0.15)),
    }
    monkeypatch.setattr(ros_world, "request_service", lambda *given: SimpleNamespace(twist=twists[given[2].model_name]))
    assert moving_objects(twists) == ["falling", "rolling"]


@pytest.mark.parametrize(("moving_s", "waited_s"), [(0.0, 0.0), (0.3, 0.3), (100.0, 9.5)])
def test_objects_are_waited_for_until_they_rest(
    monkeypatch: pytest.MonkeyPatch, moving_s: float, waited_s: float
) -> None:
    slept: list[float] = []
    falling, resting = (twist((0.0, 0.0, speed), (0.0, 0.0, 0.0)) for speed in (-1.0, 0.0))
    monkeypatch.setattr(
        ros_world,
        "request_service",
        lambda *given: SimpleNamespace(twist=falling if sum(slept) < moving_s - 1e-9 else resting),
    )
    wait_for_rest(["cube"], 9.5, slept.append)
    assert sum(slept) == pytest.approx(waited_s)
