# SPDX-License-Identifier: BSD-3-Clause
"""Eight clients plan at once while the scene changes: every answer is right, all of them come. Longer: benchmarks."""

from __future__ import annotations

from typing import Any

from modular_framework_testing.planning.planning_stress_clients import stress


def test_many_clients_get_right_answers_while_the_scene_changes(ros_session: Any) -> None:
    figures = stress(ros_session, seconds=10.0, clients=8, step=0.05)
    assert figures["unanswered"] == 0 and figures["wrong"] == 0, figures
    assert figures["motions_checked"] >= 8 and figures["scene_changes"] >= 20, figures
    assert ros_session.alive(), ros_session.log()
