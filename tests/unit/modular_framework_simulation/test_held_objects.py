# SPDX-License-Identifier: BSD-3-Clause
"""An object stays where it is in a hand that swings, by friction alone."""

from __future__ import annotations

import importlib.util
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    """benchmarks/held_objects."""
    path = Path(__file__).resolve().parents[3] / "benchmarks" / "held_objects"
    loader = SourceFileLoader("held_objects", str(path))
    spec = importlib.util.spec_from_loader("held_objects", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["held_objects"] = module
    loader.exec_module(module)
    return module


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("thing", ["cube_0.1", "cylinder_0.5", "ball_0.3"])
def test_an_object_stays_in_a_swinging_hand(benchmark: Any, thing: str, engine: str) -> None:
    row = benchmark.measure("ur5_ezgripper", thing, 5.0, PhysicsSettings(), engine)
    assert row.held
    assert row.worst_mm < 0.5
    assert thing.startswith("ball") or row.worst_deg < 1.0


def test_an_object_that_is_let_go_falls_freely(benchmark: Any) -> None:
    trial = benchmark.HeldObject(benchmark.HANDS["ur5_ezgripper"], benchmark.things()["cube_0.1"], PhysicsSettings())
    trial.grasp()
    world: PhysicsWorld = trial.world
    (held,) = trial.loop.held_objects()
    assert held.model == "thing"
    before = trial.thing.state().pose.position[2]
    for _ in range(round(1.0 / world.settings.time_step_s)):
        trial.handles[trial.hand.gripper].command = trial.hand.opened
        trial.loop.step()
    assert trial.loop.held_objects() == ()
    assert before - trial.thing.state().pose.position[2] > 0.3
    world.delete("thing")
    trial.loop.step()
    world.close()
