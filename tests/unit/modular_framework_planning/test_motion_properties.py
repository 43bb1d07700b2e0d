# SPDX-License-Identifier: BSD-3-Clause
"""Motions of every pipeline have the properties a robot relies on; all 200 problems each: benchmarks/properties."""

from __future__ import annotations

import os

import pytest

from modular_framework_planning.robot_model.urdf_document import package_resolver
from modular_framework_testing.planning.independent_checker import IndependentChecker
from modular_framework_testing.planning.motion_properties import examine

SHARE = {"ompl": 8, "ptp": 8, "lin": 12, "stomp": 5}
LEAST_SOLVED = {"ompl": 0.95, "ptp": 0.25, "lin": 0.25, "stomp": 0.8}  # straight motions are refused where they touch


@pytest.mark.parametrize("kind", SHARE)
def test_random_motions_have_all_properties(robot: object, kind: str) -> None:
    """PROPERTY_PROBLEMS sets the number of problems of each pipeline."""
    count = int(os.environ.get("PROPERTY_PROBLEMS", SHARE[kind]))
    checker = IndependentChecker(robot.urdf, robot.srdf, package_resolver)
    tally = examine(robot.model, checker, kind, count)
    print(f"{kind}: {tally.solved} solved, {tally.unsolved_count} not")
    assert not tally.violations
    assert tally.solved >= LEAST_SOLVED[kind] * count, tally.refusals
