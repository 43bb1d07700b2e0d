# SPDX-License-Identifier: BSD-3-Clause
"""An episode is invalid when others than the task change its world, or publish what the world publishes itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import rospy
from actionlib_msgs.msg import GoalID
from moveit_msgs.msg import ExecuteTrajectoryActionGoal, ExecuteTrajectoryActionResult

from modular_framework_benchmark.episodes import ros_samples, ros_world
from modular_framework_benchmark.episodes.ros_samples import GRASPED, REPORTS, TASK_STATUS, Samples
from modular_framework_benchmark.episodes.ros_world import (
    InterferenceError,
    Judgement,
    WorldError,
    aborted_interference,
)

RESTART = {"number": 4, "time_s": 0.01, "what": "/gazebo/restart", "caller": "/episode_recorder"}
RESET = {"number": 5, "time_s": 1.0, "what": "/gazebo/reset_world", "caller": "/task"}
PUT = {"number": 6, "time_s": 2.5, "what": "/gazebo/set_model_state", "caller": "/method"}
JUMP = {"number": 7, "time_s": 3.0, "what": "a jump of 'cube' by 0.500 m", "caller": ""}


@pytest.mark.parametrize(
    ("interventions", "foul"),
    [
        ([RESTART], ""),
        ([RESTART, RESET], ""),
        (
            [RESTART, PUT],
            "the world was changed outside its physics by a node named '/method': /gazebo/set_model_state at 2.500 s",
        ),
        ([RESTART, JUMP], "the world was changed outside its physics: a jump of 'cube' by 0.500 m at 3.000 s"),
        (
            [RESTART, JUMP, PUT],
            "the world was changed outside its physics: a jump of 'cube' by 0.500 m at 3.000 s, and 1 more",
        ),
    ],
)
def test_changes_since_the_objects_were_placed_are_foul_unless_the_task_made_them(
    interventions: list[dict[str, Any]], foul: str
) -> None:
    assert Judgement((), {}, interventions).interference(since=4) == foul


def test_the_latest_intervention_is_where_the_episode_begins() -> None:
    assert Judgement((), {}, []).number == 0
    assert Judgement((), {}, [RESTART, PUT]).number == 6


class WireFake:
    """Receives for a topic what a test sends, as rospy does."""

    callbacks: dict[str, Any] = {}

    def __init__(self, topic: str, _kind: Any, callback: Any, **_options: Any) -> None:
        self.callbacks[topic] = callback

    @classmethod
    def send(cls, topic: str, sender: str, text: str = "", **fields: Any) -> None:
        """Delivers a text or a message with the given fields, from a named sender."""
        header = {"_connection_header": {"callerid": sender}}
        cls.callbacks[topic](SimpleNamespace(**header, **(fields or {"data": text})))


class MasterFake:
    """A master that also knows the topics of two actions."""

    def __init__(self, _name: str) -> None: ...

    def getTopicTypes(self) -> list[list[str]]:  # noqa: N802  # a name of ROS
        """Returns the goals' topics with their types."""
        return [
            ["/execute_trajectory/goal", "moveit_msgs/ExecuteTrajectoryActionGoal"],
            ["/grasp/goal", "modular_framework_core/GraspActionGoal"],
        ]


def test_messages_of_another_node_than_the_topics_own_are_dropped_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rospy, "Subscriber", WireFake)
    monkeypatch.setattr(ros_samples.rosgraph, "Master", MasterFake)
    samples = Samples()
    samples.connect()
    WireFake.send(GRASPED, "/gazebo", "cube")
    WireFake.send(REPORTS, "/move_group", '{"kind": "plan"}')
    WireFake.send(TASK_STATUS, "/task", '{"event": "task_end", "succeeded": false}')
    assert samples.interference() == ""

    WireFake.send(REPORTS, "/viewer", '{"kind": "plan"}')  # of no consequence, and not counted either
    assert samples.interference() == "" and len(samples.planning) == 1
    WireFake.send(GRASPED, "/method", "cube")
    WireFake.send(TASK_STATUS, "/method", '{"event": "task_end", "succeeded": true}')
    assert samples.interference() == (
        "a node named '/method' publishes /gazebo/grasped_object; a node named '/method' publishes task_status"
    )
    assert [end["succeeded"] for end in samples.ends] == [False]
    samples.clear()
    assert samples.interference() == "" and samples.ends == []


def ended(number: str) -> dict[str, Any]:
    """The fields of the result of a goal that succeeded."""
    result = ExecuteTrajectoryActionResult()
    result.status.goal_id.id, result.status.status, result.result.error_code.val = number, ros_samples.SUCCEEDED, 1
    return {"header": result.header, "status": result.status, "result": result.result}


def test_a_method_cannot_report_plans_and_motions_in_place_of_those_who_make_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rospy, "Subscriber", WireFake)
    monkeypatch.setattr(ros_samples.rosgraph, "Master", MasterFake)
    samples = Samples()
    samples.connect()
    WireFake.send("component_reports", "/method", '{"component": "generation"}')
    WireFake.send("/grasp/result", "/grasp_server", **ended("a"))
    WireFake.send("/execute_trajectory/result", "/move_group", **ended("b"))
    assert samples.interference() == "" and len(samples.components) == 1

    WireFake.send("component_reports", "/method", '{"component": "planning"}')
    WireFake.send("/execute_trajectory/result", "/method", **ended("never executed"))
    WireFake.send("/grasp/result", "/method", **ended("c"))
    assert samples.interference() == (
        "a node named '/method' publishes /execute_trajectory/result; a node named '/method' publishes /grasp/result; "
        "a node named '/method' publishes component_reports of 'planning'"
    )
    assert len(samples.components) == 1
    samples.add_goal("execution", ExecuteTrajectoryActionGoal(goal_id=GoalID(id="never executed")))
    assert samples.actions() == []


@pytest.mark.parametrize(
    ("simulation", "foul"),
    [
        (Judgement((), {}, [RESTART]), ""),
        (Judgement((), {}, [RESTART, PUT]), Judgement((), {}, [PUT]).interference(since=4)),
        (InterferenceError("'/gazebo/referee' is answered by '/method'"), "'/gazebo/referee' is answered by '/method'"),
        (WorldError("the simulation does not answer"), ""),
    ],
)
def test_an_episode_that_is_aborted_at_its_time_limit_is_judged(
    simulation: Judgement | WorldError, foul: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def judge(_timeout_s: float) -> Judgement:
        if isinstance(simulation, WorldError):
            raise simulation
        return simulation

    monkeypatch.setattr(ros_world, "judge", judge)
    assert aborted_interference(since=4) == foul
