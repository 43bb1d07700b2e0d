# SPDX-License-Identifier: BSD-3-Clause
"""What the viewer's page says about the simulation, and the world of a restarted simulation."""

from __future__ import annotations

from unittest.mock import MagicMock

import pytest

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.sensors.scene_text import ScenePoses, VisibleLink, VisibleModel
from modular_framework_simulation.viewer.simulation_status import MAX_SILENCE_S, Phase, SimulationWatch
from modular_framework_simulation.viewer.world_view import WorldView


def poses(time_s: float, paused: bool = False) -> ScenePoses:
    return ScenePoses(round(time_s * 1e9), paused, {})


def text(watch: SimulationWatch, now_s: float) -> str:
    return str(watch.status(now_s))


def test_the_page_says_what_is_known_about_the_simulation() -> None:
    watch = SimulationWatch()
    assert text(watch, 0.0) == "Looking for a simulation."
    for found, expected in (
        (None, "The ROS master does not respond."),
        (False, "No simulation is running."),
        (True, "Waiting for the first state of the simulation."),
    ):
        watch.note_search(found)
        assert text(watch, 1.0) == expected and not watch.status(1.0).has_controls
    watch.note_poses(poses(5.0), 10.0)
    watch.note_poses(poses(5.5), 11.0)
    assert text(watch, 11.1) == "Time 5.50 s, real time factor 0.50." and watch.status(11.1).has_controls
    watch.note_poses(poses(5.5, paused=True), 11.2)
    assert text(watch, 11.3) == "Time 5.50 s, paused."


def test_silence_is_named_and_ends_with_the_next_poses() -> None:
    watch = SimulationWatch()
    watch.note_search(True)
    watch.note_poses(poses(7.0), 100.0)
    assert watch.status(100.0 + MAX_SILENCE_S).phase is Phase.RUNNING
    assert text(watch, 105.0) == "The simulation has not responded for 5 s, since time 7.00 s."
    watch.note_poses(poses(0.1), 106.0)  # restarted
    assert text(watch, 106.0) == "Time 0.10 s, real time factor 0.00."


@pytest.mark.parametrize(("found", "phase"), [(False, Phase.ABSENT), (None, Phase.NO_MASTER)])
def test_poses_count_more_than_the_master_and_silence_less(found: bool | None, phase: Phase) -> None:
    watch = SimulationWatch()
    watch.note_poses(poses(7.0), 100.0)
    watch.note_search(found)
    assert watch.status(100.1).phase is Phase.RUNNING
    assert watch.status(110.0).phase is phase
    watch.note_poses(poses(8.0), 111.0)
    assert watch.status(111.0).phase is Phase.RUNNING


def test_the_next_browser_does_not_see_the_status_of_the_previous_browser() -> None:
    watch = SimulationWatch()
    watch.note_search(True)
    watch.note_poses(poses(7.0), 100.0)
    watch.forget()
    assert text(watch, 100.1) == "Looking for a simulation."


def model(geometry: specs.Geometry) -> VisibleModel:
    seen = specs.Visual("v", Pose(), geometry, (1.0, 1.0, 1.0, 1.0))
    return VisibleModel(1, "thing", (VisibleLink("link", (seen,)),))


def test_a_model_of_a_restarted_simulation_replaces_the_model_with_its_number() -> None:
    layer = MagicMock()
    world = WorldView(layer, pytest.fail)
    assert world.is_empty
    world.show([model(specs.Box((1.0, 1.0, 1.0)))])
    world.show([model(specs.Box((1.0, 1.0, 1.0)))])
    assert layer.add.call_count == 1 and not world.is_empty
    world.show([model(specs.Sphere(0.5))])
    layer.remove.assert_called_once_with("thing/link")
    assert layer.add.call_count == 2
    world.show(())
    assert world.is_empty
