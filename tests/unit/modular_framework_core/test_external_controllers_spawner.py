# SPDX-License-Identifier: BSD-3-Clause
"""A manipulator whose hardware brings the action server needs no node of its own: the launch goes on without one."""

from __future__ import annotations

import pytest

from modular_framework_core.launching import ros_external_controllers
from modular_framework_core.launching.external_controllers import PACKAGE_KEY


def test_without_a_node_to_start_the_spawner_stays_until_ros_shuts_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """The launch requires the spawner: its end would be the end of all other nodes."""
    stayed: list[str] = []
    rospy = ros_external_controllers.rospy
    monkeypatch.setattr(rospy, "init_node", lambda *_, **__: None)
    monkeypatch.setattr(rospy, "has_param", lambda name: name == PACKAGE_KEY)
    monkeypatch.setattr(rospy, "get_param", lambda name: "")
    monkeypatch.setattr(rospy, "spin", lambda: stayed.append("until the shutdown"))
    assert ros_external_controllers.main() == 0
    assert stayed == ["until the shutdown"]
