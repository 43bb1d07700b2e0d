# SPDX-License-Identifier: BSD-3-Clause
"""In simulation, fingers that stopped on something else than the object of the grasp hold nothing."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from modular_framework_states.states import grasp as grasp_state
from modular_framework_states.states.grasp import Grasp


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Fingers that report that something stopped them, and a planning scene with what they really hold."""
    world = SimpleNamespace(simulation=True, held={}, object_id="can__link")
    monkeypatch.setattr(grasp_state, "SCENE_TIMEOUT_S", 0.2)
    monkeypatch.setattr(grasp_state, "rospy", SimpleNamespace(get_param=lambda *_: world.simulation))
    monkeypatch.setattr(
        grasp_state, "selected_or_named", lambda *_: SimpleNamespace(object_id=world.object_id, grasp_id="g")
    )
    monkeypatch.setattr(grasp_state, "send", lambda *_, **__: None)
    monkeypatch.setattr(grasp_state, "held_objects", lambda: dict(world.held))
    return world


def run(verify_held: bool = True) -> tuple[str, str]:
    state = Grasp("grasp", "g", verify_held=verify_held)
    outcome = state.execute(SimpleNamespace(manipulator_controller_client=None, max_torque=1.0))
    return outcome, state.reason


@pytest.mark.parametrize(
    ("held", "object_id", "outcome"),
    [
        ({}, "can__link", "fail"),
        ({}, "", "fail"),
        ({"mug__link": "palm"}, "can__link", "fail"),
        ({"can__link": "palm"}, "can__link", "success"),
        ({"mug__link": "palm"}, "", "success"),
    ],
)
def test_only_the_object_of_the_grasp_counts_as_held(
    world: SimpleNamespace, held: dict[str, str], object_id: str, outcome: str
) -> None:
    world.held, world.object_id = held, object_id
    assert run()[0] == outcome
    assert ("stopped on something else" in run()[1]) == (outcome == "fail")


def test_without_a_simulation_or_the_option_the_fingers_alone_decide(world: SimpleNamespace) -> None:
    assert run(verify_held=False) == ("success", "")
    world.simulation = False
    assert run() == ("success", "")
