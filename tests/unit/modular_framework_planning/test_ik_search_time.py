# SPDX-License-Identifier: BSD-3-Clause
"""A search for inverse kinematics takes the time that a client gave it."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("moveit_msgs", reason="source the workspace")

from modular_framework_planning.move_group.capabilities import kinematics_service  # noqa: E402


@pytest.mark.parametrize(
    ("seed", "requested_s", "expected"),
    [(None, 0.05, 0.05), (None, 25.0, 25.0), (None, 0.0, None), (None, -1.0, None), (3, 0.05, math.inf)],
)
def test_the_whole_requested_time_is_used_unless_a_seed_makes_results_repeatable(
    seed: int | None, requested_s: float, expected: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kinematics_service, "launch_seed", lambda: seed)
    assert kinematics_service.search_time_s(requested_s) == expected
