# SPDX-License-Identifier: BSD-3-Clause
"""The blocks of a tower are found by their numbers; what is missing is named."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from modular_framework_core.managers import ros_simulated_objects
from modular_framework_states import object_series as series_module
from modular_framework_states.object_series import SeriesError, object_series
from modular_framework_states.states import generate_grasps as generate_module
from modular_framework_states.states import next_in_tower as tower_module
from modular_framework_states.states.generate_grasps import GenerateGrasps
from modular_framework_states.states.next_in_tower import NextInTower

KEYS = ["selected_object", "selected_support"]
TABLE = ["table", "robot_pedestal"]


def test_objects_are_in_the_order_of_their_numbers() -> None:
    names = ["block_10", "block_2", *(f"block_{number}" for number in (1, 3, 4, 5, 6, 7, 8, 9)), "block_a", *TABLE]
    assert object_series("block", names) == [f"block_{number}" for number in range(1, 11)]


@pytest.mark.parametrize(
    ("names", "found"), [([], "none"), (["block_1"], "block_1"), (["block_1", "block_3"], "block_1, block_3")]
)
def test_a_tower_needs_two_objects_without_a_gap(names: list[str], found: str) -> None:
    with pytest.raises(
        SeriesError, match=f"these objects of 'block': {found}; a tower needs block_1, block_2"
    ) as fault:
        object_series("block", [*names, *TABLE])
    assert "robot_pedestal, table" in str(fault.value)


def test_models_are_named_without_their_links_and_held_objects_count(monkeypatch: pytest.MonkeyPatch) -> None:
    world = [SimpleNamespace(id=name) for name in ("block_1__link", "table__link", "table__leg")]
    held = [SimpleNamespace(object=SimpleNamespace(id="block_2__link"))]
    scene = SimpleNamespace(
        world=SimpleNamespace(collision_objects=world), robot_state=SimpleNamespace(attached_collision_objects=held)
    )
    monkeypatch.setattr(ros_simulated_objects, "request_service", lambda *arguments: SimpleNamespace(scene=scene))
    assert series_module.scene_objects() == ["block_1", "block_2", "table"]


def test_a_tower_is_gone_through_from_the_bottom(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tower_module, "scene_objects", lambda: ["block_1", "block_2", "block_3", "table"])
    state = NextInTower("block", outcomes=["next", "complete", "fail"], output_keys=KEYS)
    selected: list[Any] = []
    for _ in range(3):
        userdata = SimpleNamespace(selected_object="", selected_support="")
        selected.append((state.execute(userdata), userdata.selected_object, userdata.selected_support))
    assert selected == [("next", "block_2", "block_1"), ("next", "block_3", "block_2"), ("complete", "", "")]


def test_an_unknown_block_fails_with_the_objects_of_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tower_module, "scene_objects", lambda: ["block_1", "block_2"])
    state = NextInTower("brick", outcomes=["next", "complete", "fail"], output_keys=KEYS)
    assert state.execute(SimpleNamespace()) == "fail"
    assert "these objects of 'brick': none" in state.reason and "block_1, block_2" in state.reason
    lost = NextInTower("block", outcomes=["next", "complete", "fail"], output_keys=KEYS[:1])
    assert lost.execute(SimpleNamespace()) == "fail" and "the output keys lack selected_support" in lost.reason


@pytest.mark.parametrize(("keep", "service"), [(False, "generate_grasps"), (True, "refresh_grasps")])
def test_the_method_gets_the_object_only_for_the_call(
    monkeypatch: pytest.MonkeyPatch, keep: bool, service: str
) -> None:
    parameters = {"/my_method/object_name": "cup"}
    called: list[tuple[str, str]] = []

    def request_service(name: str, *arguments: Any) -> Any:
        called.append((name, parameters["/my_method/object_name"]))
        return SimpleNamespace(success=False, message="nothing fits")

    monkeypatch.setattr(generate_module, "request_service", request_service)
    monkeypatch.setattr(generate_module.rospy, "resolve_name", lambda name: f"/{name}")
    monkeypatch.setattr(generate_module.rosservice, "get_service_node", lambda name: "/my_method")
    monkeypatch.setattr(generate_module.rospy, "get_param", parameters.get)
    monkeypatch.setattr(generate_module.rospy, "set_param", parameters.__setitem__)
    state = GenerateGrasps("userdata", keep_grasps=keep, input_keys=["selected_object"])
    assert state.execute(SimpleNamespace(selected_object="block_2")) == "fail"
    assert called == [(service, "block_2")] and parameters == {"/my_method/object_name": "cup"}
    assert state.reason == "grasps of 'block_2': nothing fits"
    assert state.execute(SimpleNamespace(selected_object="")) == "fail" and "select an object first" in state.reason
