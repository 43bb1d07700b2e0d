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

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.physics.applied_forces import Interval, LinkWrench
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.part_names import PartName
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld

PULL_N = 60.0


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    """benchmarks/held_objects."""
    path = Path(__file__).resolve().parents[3] / "benchmarks" / "held_objects"
    sys.path.append(str(path.parent))
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
    run(trial, 5.0)  # long enough to rest in the hand
    (held,) = trial.loop.held_objects()
    assert held.model == "thing"
    before = trial.thing.state().pose.position[2]
    open_hand(trial, 1.0)
    assert trial.loop.held_objects() == ()
    assert before - trial.thing.state().pose.position[2] > 0.3
    world.delete("thing")
    trial.loop.step()
    world.close()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_weld_holds_what_friction_cannot_until_the_hand_opens(benchmark: Any, engine: str) -> None:
    def pulled(weld: bool) -> Any:
        thing = benchmark.things()["cube_0.1"]
        trial = benchmark.HeldObject(benchmark.HANDS["ur5_ezgripper"], thing, PhysicsSettings(), engine)
        trial.world.weld_grasps = weld
        trial.grasp()
        assert [held.model for held in trial.loop.held_objects()] == ["thing"]
        begin = trial.in_hand()
        pull = Interval(trial.world.time_ns, trial.world.time_ns + 200_000_000)
        trial.world.forces.add_wrench(LinkWrench(PartName("thing", "link"), (0.0, 0.0, -PULL_N), (0.0, 0.0, 0.0), pull))
        run(trial, 0.5)
        return trial, begin.distance_to(trial.in_hand())[0]

    loose, slipped_m = pulled(weld=False)
    assert slipped_m > 0.02
    loose.world.close()
    trial, moved_m = pulled(weld=True)
    assert moved_m < 0.001
    height_m = trial.thing.state().pose.position[2]
    open_hand(trial, 1.0)
    assert trial.loop.held_objects() == ()
    assert height_m - trial.thing.state().pose.position[2] > 0.3
    trial.world.close()


def test_a_weld_ends_when_the_world_is_reset_or_its_object_deleted(benchmark: Any) -> None:
    def welded() -> Any:
        thing = benchmark.things()["cube_0.1"]
        trial = benchmark.HeldObject(benchmark.HANDS["ur5_ezgripper"], thing, PhysicsSettings(rest_speed=0.0))
        trial.world.weld_grasps = True
        trial.grasp()
        assert welds(trial) == 1
        return trial

    def welds(trial: Any) -> int:
        return int(trial.world.engine.api.getNumConstraints(physicsClientId=trial.world.engine.client))

    trial = welded()
    state = trial.world.save_state()
    trial.loop.reset_poses()
    assert welds(trial) == 0
    with pytest.raises(SimulationError, match="the held objects have changed"):
        trial.world.restore_state(state)
    trial.world.close()
    trial = welded()
    trial.world.delete("thing")
    assert welds(trial) == 0
    run(trial, 0.1)
    assert trial.loop.held_objects() == ()
    trial.world.close()


def run(trial: Any, seconds: float) -> None:
    """Lets simulated time pass."""
    for _ in range(round(seconds / trial.world.settings.time_step_s)):
        trial.loop.step()


def open_hand(trial: Any, seconds: float) -> None:
    """Opens the fingers."""
    for _ in range(round(seconds / trial.world.settings.time_step_s)):
        trial.handles[trial.hand.gripper].command = trial.hand.opened
        trial.loop.step()
