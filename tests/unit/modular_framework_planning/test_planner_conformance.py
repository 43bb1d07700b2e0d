# SPDX-License-Identifier: BSD-3-Clause
"""The shipped planners, and the planner of the documentation, pass the conformance suite of planners."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_testing.planning.planner_conformance import PlannerConformance

DOCUMENTATION = Path(__file__).resolve().parents[3] / "docs" / "planning.md"


class TestOmpl(PlannerConformance):
    plugin = "ompl_interface/OMPLPlanner"


class TestStomp(PlannerConformance):
    plugin = "stomp_moveit/StompPlannerManager"
    avoids_obstacles = False  # the search is local


class TestPilz(PlannerConformance):
    plugin = "pilz_industrial_motion_planner/CommandPlanner"
    planner_id = "PTP"
    adapters = ""
    avoids_obstacles = False


class TestOneStop(PlannerConformance):
    """The planner that users copy from the documentation."""

    plugin = "planner_of_the_documentation/OneStop"

    @pytest.fixture(autouse=True)
    def module(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        code = re.search(r"```python\n(.*?class OneStop.*?)```", DOCUMENTATION.read_text(), re.DOTALL)
        assert code is not None
        (tmp_path / "planner_of_the_documentation.py").write_text(code[1])
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "planner_of_the_documentation", raising=False)


class Deaf(Planner):
    """Searches without a look at the clock or at the client."""

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        goal = problem.goal_states()[0]
        for _ in range(40):
            if problem.edge_is_valid(problem.start_values, goal):
                break
            time.sleep(0.05)
        return PlannedPath(np.vstack([problem.start_values, goal]))


class Careless(Planner):
    """Forgets the goal."""

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        return PlannedPath(np.vstack([problem.start_values, problem.start_values + 0.1]))


@pytest.mark.parametrize(
    ("planner", "test"),
    [
        (Deaf, "test_a_cancelled_request_ends_at_once"),
        (Careless, "test_a_free_motion_joins_start_and_goal_within_the_limits"),
        (Careless, "test_a_goal_in_collision_is_an_error_that_names_the_bodies"),
    ],
)
def test_a_planner_with_a_fault_does_not_pass(planner: type[Planner], test: str) -> None:
    suite = PlannerConformance()
    suite.plugin = f"{planner.__module__}/{planner.__name__}"
    suite.setup_method()
    with pytest.raises(AssertionError):
        getattr(suite, test)()
