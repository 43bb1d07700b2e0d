# SPDX-License-Identifier: BSD-3-Clause
"""Command `make_problems`: generates random motion planning problems for a robot."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.problem_generation import make_problems, write_problems
from modular_framework_benchmark.modes.ros_robots import load_robot
from modular_framework_planning.errors import PlanningError


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns 0, or 2 after an error."""
    parser = argparse.ArgumentParser(
        prog="make_problems",
        description="Generates motion planning problems for a robot: random boxes, collision-free start and goal.",
    )
    parser.add_argument("robot", metavar="PACKAGE", help="MoveIt configuration package of the robot")
    parser.add_argument("group", help="planning group")
    parser.add_argument("into", type=Path, metavar="FOLDER", help="folder of sceneNNNN.yaml and requestNNNN.yaml")
    parser.add_argument("--count", type=_positive, default=20, help="number of problems [20]")
    parser.add_argument("--boxes", type=_positive, default=8, help="number of boxes per problem [8]")
    parser.add_argument("--seed", type=int, default=1, help="seed that reproduces the problems [1]")
    options = parser.parse_args(arguments)
    try:
        robot = load_robot(options.robot)
        write_problems(make_problems(robot, options.group, options.count, options.boxes, options.seed), options.into)
    except (ModeError, PlanningError, OSError) as error:
        print(f"make_problems: {error}", file=sys.stderr)
        return 2
    print(f"{options.count} problems for group '{options.group}' of {options.robot} are in {options.into}")
    return 0


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not allowed; use 1 or more")
    return value
