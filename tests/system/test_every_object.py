# SPDX-License-Identifier: BSD-3-Clause
"""The shipped task picks every object of the standard set, and recovers from grasps that fail at the object."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from modular_framework_testing.picks.pick_objects import OBJECTS
from modular_framework_testing.ros_session import RosSession

API = Path(__file__).parents[2] / "src" / "modular_framework_api"
SCRIPT = API / "task_constructor_scripts" / "simulation_pick.yaml"
ALL_S = 1800.0
LIFTED_M = 0.10


@pytest.fixture(scope="module")
def picks() -> Iterator[dict[str, Any]]:
    """What became of each object, all of them picked in one launch."""
    session = RosSession()
    session.env.pop("DISPLAY", None)
    try:
        launch = session.launch_package(
            "modular_framework_api",
            "start_framework.launch",
            gui="false",
            rviz="false",
            world_file="ur5_table.world",
            end_with_task="false",
            wait_for_planning="true",
            real_time_factor="0",
        )
        run = subprocess.run(
            [sys.executable, "-m", "modular_framework_testing.picks.pick_objects", str(SCRIPT)],
            env=session.env,
            capture_output=True,
            text=True,
            timeout=ALL_S,
            check=False,
        )
        found = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
        yield {"all": run.stderr[-3000:] + launch.log()[-6000:]} | {each["case"]: each for each in found}
    finally:
        session.stop()


@pytest.mark.parametrize("model", sorted(OBJECTS))
def test_every_object_of_the_standard_set_is_picked(picks: dict[str, Any], model: str) -> None:
    assert model in picks, picks["all"]
    pick = picks[model]
    assert pick["exit_code"] == 0, pick["log"]
    assert pick["held"] and pick["lifted_m"] > LIFTED_M, pick


def test_a_task_whose_first_grasps_fail_at_the_object_lets_go_and_picks_it_by_another(picks: dict[str, Any]) -> None:
    assert "second_try" in picks, picks["all"]
    pick = picks["second_try"]
    assert "state machine goes from 'PlanLift' by 'fail'" in pick["log"], pick["log"]
    assert "state machine goes from 'OpenGripper' by 'fail'" not in pick["log"], pick["log"]
    assert pick["exit_code"] == 0, pick["log"]
    assert pick["held"] and pick["lifted_m"] > LIFTED_M, pick
