# SPDX-License-Identifier: BSD-3-Clause
"""What is collected of an episode does not depend on the order in which messages of several nodes come."""

from __future__ import annotations

import pytest
from moveit_msgs.msg import ExecuteTrajectoryActionGoal, ExecuteTrajectoryActionResult

from modular_framework_benchmark.episodes.ros_samples import SUCCEEDED, Samples
from modular_framework_ros.component_report import ReportedMethod


def goal(number: str, stamp_s: int) -> ExecuteTrajectoryActionGoal:
    message = ExecuteTrajectoryActionGoal()
    message.goal_id.id, message.header.stamp.secs = number, stamp_s
    return message


def result(number: str, stamp_s: int, code: int = 1) -> ExecuteTrajectoryActionResult:
    message = ExecuteTrajectoryActionResult()
    message.status.goal_id.id, message.status.status, message.header.stamp.secs = number, SUCCEEDED, stamp_s
    message.result.error_code.val = code
    return message


@pytest.fixture
def samples() -> Samples:
    return Samples()


@pytest.mark.parametrize("order", ["ggrr", "grgr", "rgrg", "rrgg"])
def test_a_goal_and_its_result_belong_together_whichever_comes_first(samples: Samples, order: str) -> None:
    goals, results = [goal("a", 1), goal("b", 5)], [result("a", 3), result("b", 7, code=-4)]
    for letter in order:
        assert not samples.actions() or len(samples.actions()) == 1
        if letter == "g":
            samples.add_goal("execution", goals.pop(0))
        else:
            samples.add_result(results.pop(0))
    found = [(each["ros"], each["ros_end"], each["succeeded"], each["reason"]) for each in samples.actions()]
    assert found == [(1.0, 3.0, True, ""), (5.0, 7.0, False, "error code -4")]
    assert all(each["wall"] <= each["wall_end"] for each in samples.actions())
    assert samples.actions_ended()


def test_a_goal_without_a_result_has_not_ended(samples: Samples) -> None:
    samples.add_goal("execution", goal("a", 1))
    assert samples.actions() == []
    assert not samples.actions_ended()
    samples.clear()
    assert samples.actions_ended()


def test_the_methods_that_components_report_are_found_whatever_else_they_report(samples: Samples) -> None:
    method = {"command": ["python3", "policy.py"], "address": "", "sources": "aa", "said_name": "reach", "other": 1}
    samples.components += [(0.0, {"component": "policy", "method": method}), (1.0, {"component": "my_camera"})]
    assert samples.process_methods() == [
        ReportedMethod(command=("python3", "policy.py"), sources="aa", said_name="reach")
    ]
