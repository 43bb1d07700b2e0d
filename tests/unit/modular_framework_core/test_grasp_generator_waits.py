# SPDX-License-Identifier: BSD-3-Clause
"""The grasp generator waits for what comes late by the clock of ROS, and says what it waited for when it gives up."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from modular_framework_core.grasp_generation import ros_grasp_generator as node
from modular_framework_core.grasp_generation import surface_points
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_core.grasp_generation.wait_limit import WaitLimit
from modular_framework_ros.calls import CallError

LIMIT_S = 20.0
EMPTY = node.NoObjectError("no object of the planning scene is in the crop box")
BUSY = CallError("service '/get_planning_scene' did not answer within 10.0 s")
BOX = [SceneObject("box__link", surface_points.box((0.04, 0.07, 0.1)))]


def test_patience_ends_a_limit_after_the_first_question():
    wait_limit = WaitLimit()
    assert [wait_limit.is_exceeded(now, LIMIT_S) for now in (100.0, 119.9, 120.1)] == [False, False, True]


def test_patience_begins_when_the_clock_of_a_simulation_does_and_again_when_it_is_reset():
    wait_limit = WaitLimit()
    assert not wait_limit.is_exceeded(0.0, LIMIT_S)
    assert [wait_limit.is_exceeded(now, LIMIT_S) for now in (300.0, 5.0, 24.0, 26.0)] == [False, False, False, True]


class Scripted(node.GraspGenerator):
    """Sees what a script says, one scene after the other, and stores what it signalled."""

    def __init__(self, scenes: list[object], makes: Callable[[], list[object]], attached: Iterable[str]) -> None:
        super().__init__(SimpleNamespace())
        self._scene = SimpleNamespace(targets=self._next_scene, attached=set(attached))
        self.scenes, self.makes, self.signals = list(scenes), makes, []
        self._stored = SimpleNamespace(replace=lambda grasps, prefix: None)
        self._reporter = SimpleNamespace(work=lambda name: nullcontext(SimpleNamespace(figures={}, reason="")))

    def _next_scene(self, settings):
        scene = self.scenes.pop(0)
        if isinstance(scene, Exception):
            raise scene
        return scene

    def _generate(self, settings, objects, figures):
        return self.makes()

    def _publish(self, success, text):
        self.signals.append((success, text))


@pytest.fixture
def watched(monkeypatch):
    """Lets a generator look at scripted scenes, some seconds of the ROS clock apart; returns what it signalled."""

    def watch(scenes, period_s=1.0, makes=lambda: [SimpleNamespace(object_id="box__link")], attached=frozenset()):
        monkeypatch.setattr(node.SimulatedTime, "enabled", False)
        generator = Scripted(scenes, makes, attached)
        clock = SimpleNamespace(now=50.0)

        def sleep(_wall_s: float) -> None:
            clock.now += period_s

        monkeypatch.setattr(node, "read_settings", lambda: SimpleNamespace(scene_timeout_s=LIMIT_S, name_prefix=""))
        monkeypatch.setattr(
            node,
            "rospy",
            SimpleNamespace(
                get_time=lambda: clock.now,
                get_name=lambda: "/grasp_generator",
                is_shutdown=lambda: not generator.scenes,
                loginfo_throttle=lambda *_: None,
                rostime=SimpleNamespace(wallsleep=sleep),
            ),
        )
        generator.watch()
        return generator.signals

    return watch


def test_an_object_that_comes_late_on_a_slow_machine_is_grasped(watched):
    assert watched([EMPTY] * 400 + [BOX] * 3, period_s=0.04) == [(True, "1 grasps of ['box__link'] were stored")]


def test_giving_up_is_signalled_once_and_says_what_was_missing_and_how_long(watched):
    signals = watched([EMPTY] * 60)
    assert signals == [(False, f"{EMPTY} (waited 20 s of the ROS clock)")]


def test_the_wait_for_an_object_begins_when_the_scene_is_there(watched):
    assert watched([BUSY] * 15 + [EMPTY] * 15 + [BOX] * 2) == [(True, "1 grasps of ['box__link'] were stored")]


def test_a_scene_that_is_never_there_is_given_up_with_its_reason(watched):
    assert watched([BUSY] * 60) == [(False, f"{BUSY} (waited 20 s of the ROS clock)")]


def test_a_service_that_does_not_answer_in_time_is_asked_again(watched):
    answers = iter([CallError("service 'compute_ik' did not answer within 11.0 s"), None])

    def makes():
        error = next(answers)
        if error is not None:
            raise error
        return [SimpleNamespace(object_id="box__link")]

    assert watched([BOX] * 6, makes=makes) == [(True, "1 grasps of ['box__link'] were stored")]


def test_a_service_that_never_answers_is_given_up_with_its_reason(watched):
    def makes():
        raise CallError("service 'compute_ik' did not answer within 11.0 s")

    ((success, reason),) = watched([BOX] * 80, makes=makes)
    assert not success and reason.startswith("service 'compute_ik' did not answer")


def test_what_cannot_be_grasped_is_signalled_at_once(watched):
    def makes():
        raise node.NoGraspError("the gripper opens to 0.100 m")

    assert watched([BOX] * 3, makes=makes) == [(False, "the gripper opens to 0.100 m")]


def moved(x: float) -> list[SceneObject]:
    return [SceneObject(box.name, box.surface.transformed(np.eye(3), np.array([x, 0.0, 0.0]))) for box in BOX]


def test_an_object_that_was_moved_gives_grasps_again_once_it_rests(watched):
    assert len(watched([BOX] * 4 + [moved(0.02), moved(0.04)] + [moved(0.05)] * 4)) == 2
    assert len(watched([BOX] * 4 + [moved(0.001)] * 4)) == 1


def test_an_object_that_comes_back_to_its_place_is_a_new_one_unless_the_robot_carried_it(watched):
    assert len(watched([BOX] * 4 + [EMPTY] * 2 + [BOX] * 4)) == 2
    assert len(watched([BOX] * 4 + [EMPTY] * 2 + [BOX] * 4, attached={"box__link"})) == 1
    assert len(watched([BOX] * 4 + [EMPTY] * 2 + [moved(0.1)] * 4, attached={"box__link"})) == 2
