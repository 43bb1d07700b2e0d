# SPDX-License-Identifier: BSD-3-Clause
"""The start of move_group: which collision checker the parameter names, and what keeps the node from starting."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import rospy

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.move_group import node
from modular_framework_planning.move_group.robot_parameters import collision_detector_name


@pytest.fixture
def log(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is logged, each line with its level before it."""
    lines: list[str] = []
    for level in ("logwarn", "logerr", "logfatal"):
        monkeypatch.setattr(rospy, level, lambda text, *values, level=level: lines.append(f"{level} {text % values}"))
    return lines


@pytest.mark.parametrize(
    ("value", "name", "parts"),
    [
        (None, "", ()),
        ("Bullet", "Bullet", ()),
        ("hybrid", "hybrid", ()),
        ("my_checkers/MyChecker", "my_checkers/MyChecker", ()),
        ("Distance_Field", "", ("logerr", "'Distance_Field'", "allowed: FCL, Bullet, HYBRID", "FCL is used")),
        ({"name": "FCL"}, "", ("logwarn", "/collision_detector", "FCL is used")),
    ],
)
def test_the_name_of_the_collision_checker(
    value: Any, name: str, parts: tuple[str, ...], log: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rospy, "search_param", lambda key: None if value is None else f"/{key}")
    monkeypatch.setattr(rospy, "get_param", lambda key: value)
    assert collision_detector_name() == name
    assert len(log) == bool(parts) and all(part in log[0] for part in parts)


def refuse(scene: Any) -> Any:
    raise PlanningError(-1, "a shape cannot be checked")


@pytest.mark.parametrize(
    ("new_checker", "reason"),
    [(refuse, "a shape cannot be checked"), (lambda scene: SimpleNamespace(), "lacks the attribute model")],
)
def test_a_checker_that_cannot_check_the_scene_keeps_the_node_from_starting(
    new_checker: Any, reason: str, log: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    context = SimpleNamespace(
        monitor=SimpleNamespace(snapshot=lambda: None),
        pipelines=SimpleNamespace(close=lambda: None),
        new_checker=new_checker,
    )
    for name in ("prepare", "compile_all"):
        monkeypatch.setattr(node, name, lambda: None)
    monkeypatch.setattr(node, "cache_is_empty", lambda: False)
    monkeypatch.setattr(node, "build_context", lambda: context)
    monkeypatch.setattr(rospy, "init_node", lambda name: None)
    assert node.main() == 1
    assert len(log) == 1 and "logfatal move_group cannot start" in log[0] and reason in log[0]
