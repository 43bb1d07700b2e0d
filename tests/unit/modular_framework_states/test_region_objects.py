# SPDX-License-Identifier: BSD-3-Clause
"""The objects of a region are selected in turn, the highest first, until they have left or were tried often enough."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from modular_framework_core.grasp_generation import surface_points
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject
from modular_framework_ros.calls import CallError
from modular_framework_states.place_poses import TargetRegion
from modular_framework_states.region_objects import ObjectSelection, objects_in_region
from modular_framework_states.states import next_in_region as region_module
from modular_framework_states.states.next_in_region import NextInRegion

TABLE = TargetRegion(name="table", x=(-0.5, 0.2), y=(0.2, 0.9), z=(0.84, 1.2))
REGIONS = {"table": {"x": [-0.5, 0.2], "y": [0.2, 0.9], "z": [0.84, 1.2]}, "bin": {"x": [0.3, 0.5], "y": [0.3, 0.6]}}
OUTCOMES = ["next", "complete", "fail"]


def box(name: str, height: float, x: float = 0.0, bottom: float = 0.84) -> SceneObject:
    """A box of 50 mm by 50 mm at y = 0.5."""
    surface = surface_points.box((0.05, 0.05, height))
    return SceneObject(name, surface.transformed(np.eye(3), np.array([x, 0.5, bottom + height / 2])))


CUBE, CARTON, FLAT = box("cube__link", 0.05), box("carton__link", 0.12, -0.3), box("flat__link", 0.02, -0.1)


def test_the_highest_object_comes_first_and_furniture_and_objects_elsewhere_are_left_out() -> None:
    furniture = [box("table__link", 0.84, bottom=0.0), box("bin__link", 0.13, 0.4), box("can__link", 0.1, 0.35)]
    assert objects_in_region([FLAT, CUBE, *furniture, CARTON], TABLE) == ["carton", "cube", "flat"]
    on_top = box("top__link", 0.02, bottom=0.96)
    assert objects_in_region([CARTON, on_top], TABLE) == ["top", "carton"]


def test_a_model_of_several_links_is_one_object() -> None:
    assert objects_in_region([box("lamp__foot", 0.02), box("lamp__arm", 0.2), CUBE], TABLE) == ["lamp", "cube"]


def test_each_object_is_selected_before_one_is_selected_again() -> None:
    selection = ObjectSelection(2)
    names = ["carton", "cube", "flat"]
    assert [selection.next_of(names) for _ in range(7)] == [*names, *names, None]


def test_selections_count_anew_after_an_object_has_left() -> None:
    selection = ObjectSelection(1)
    assert [selection.next_of(["carton", "cube"]) for _ in range(2)] == ["carton", "cube"]
    assert selection.next_of(["cube"]) == "cube"
    assert selection.next_of(["cube"]) is None
    assert selection.next_of(["cube", "carton"]) == "carton", "an object that has returned"
    assert selection.next_of(["carton", "cube"]) is None, "so that the selections end"


class FakeScene:
    """Readings of the planning scene, one after the other."""

    def __init__(self, *readings: list[SceneObject] | CallError) -> None:
        self._readings = list(readings)

    def connect(self, timeout_s: float) -> None:
        """Stands in for a wait for move_group."""

    def read(self) -> list[SceneObject]:
        reading = self._readings.pop(0)
        if isinstance(reading, CallError):
            raise reading
        return reading


def state(monkeypatch: pytest.MonkeyPatch, *readings: list[SceneObject] | CallError, **options: object) -> NextInRegion:
    """A state whose planning scene has the given objects."""
    monkeypatch.setattr(region_module.rospy, "get_param", lambda *_: REGIONS)
    monkeypatch.setattr(region_module, "SceneObjects", lambda: FakeScene(*readings))
    given = {"region": "table", "outcomes": OUTCOMES, "output_keys": ["selected_object"], **options}
    return NextInRegion(**given)  # type: ignore[arg-type]


def test_the_task_is_complete_without_an_object_in_the_region(monkeypatch: pytest.MonkeyPatch) -> None:
    cleared = state(monkeypatch, [CUBE, FLAT], [CUBE], [])
    userdata = SimpleNamespace(selected_object="")
    selected = [(cleared.execute(userdata), userdata.selected_object) for _ in range(2)]
    assert selected == [("next", "cube"), ("next", "cube")]
    assert cleared.execute(userdata) == "complete"


def test_objects_that_cannot_be_removed_end_the_task_with_their_names(monkeypatch: pytest.MonkeyPatch) -> None:
    stuck = state(monkeypatch, *[[CUBE, FLAT]] * 3, attempts=1)
    assert [stuck.execute(SimpleNamespace()) for _ in range(3)] == ["next", "next", "fail"]
    assert stuck.reason == (
        "each of the 2 objects left in region 'table' (x -0.500 to 0.200, y 0.200 to 0.900 m) was tried 1 times "
        "without success: cube, flat"
    )


def test_what_the_state_cannot_read_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    unknown = state(monkeypatch, region="tabel")
    assert unknown.execute(SimpleNamespace()) == "fail"
    assert "region 'tabel' does not exist; /regions has: bin, table" in unknown.reason
    silent = state(monkeypatch, CallError("no answer of 'get_planning_scene'"))
    assert silent.execute(SimpleNamespace()) == "fail" and "get_planning_scene" in silent.reason
    lost = state(monkeypatch, output_keys=[])
    assert lost.execute(SimpleNamespace()) == "fail" and "the output keys lack selected_object" in lost.reason
