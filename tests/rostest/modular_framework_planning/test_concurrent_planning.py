# SPDX-License-Identifier: BSD-3-Clause
"""Motions planned at the same time are those that are planned one by one with the same seeds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_testing.planning import concurrent_motions
from modular_framework_testing.planning.planning_wire import FakeArm


@pytest.fixture(scope="module", autouse=True)
def session(ros_launch: Callable[..., Any]) -> Any:
    session = ros_launch(concurrent_motions.LAUNCH)
    session.wait_for_service("plan_kinematic_path", 300.0)
    session.arm = FakeArm()
    concurrent_motions.put_up_walls()
    return session


def test_three_motions_at_once_are_the_same_as_one_by_one() -> None:
    messages = concurrent_motions.requests()
    apart, _ = concurrent_motions.one_by_one(messages)
    together, _ = concurrent_motions.at_once(messages)
    assert together == apart
    assert len({motion[-1][1] for motion in apart}) == 3


def test_other_seeds_give_other_motions() -> None:
    first, second, third = concurrent_motions.SEEDED
    mine = concurrent_motions.requests()
    others = concurrent_motions.requests((second, third, first))
    assert concurrent_motions.at_once(mine)[0] != concurrent_motions.at_once(others)[0]
