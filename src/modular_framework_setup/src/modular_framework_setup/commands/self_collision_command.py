# SPDX-License-Identifier: BSD-3-Clause
"""Computes the pairs of links without collision check for the SRDF of a MoveIt 1 or MoveIt 2 config package.

Uses the exact shapes and the reasons of the MoveIt Setup Assistant.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from modular_framework_core.files.faults import FaultList
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.commands.command import Command, add_sampling_arguments, check_sampling
from modular_framework_setup.config_files.collision_matrix import REASONS, MatrixError, matrix_text, with_matrix
from modular_framework_setup.config_files.config_package import (
    find_package,
    folder_of,
    packages_beside,
    read_config_package,
)
from modular_framework_setup.config_files.description_files import package_document
from modular_framework_setup.creation.package_hands import hands_of
from modular_framework_setup.creation.progress_bar import ProgressBar
from modular_framework_setup.creation.self_collisions import PairVerdict, find_verdicts
from modular_framework_setup.errors import CreationError
from modular_framework_urdf.mesh_paths import mesh_path


@dataclass(frozen=True, slots=True)
class LoadedRobot:
    """The robot of a config package.

    Attributes:
        model: Robot model of URDF and SRDF.
        srdf: Path of the SRDF.
        srdf_text: SRDF text with xacro expanded.
    """

    model: RobotModel
    srdf: Path
    srdf_text: str


def main(arguments: Sequence[str] | None = None) -> int:
    """Computes the collision matrix of a config package, prints or writes it, and returns the exit code."""
    return Command("compute_self_collisions", __doc__, _add_arguments, _compute).run(arguments)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("package", help="ROS package or folder, which need not be built")
    add_sampling_arguments(parser)
    parser.add_argument("--write", action="store_true", help="replace the matrix in the SRDF; default: print it")


def _compute(args: argparse.Namespace) -> int:
    check_sampling(args)
    folder = folder_of(args.package)
    with packages_beside(folder):
        robot = _load(folder)
    origin = f"{args.samples} random states, seed {args.seed}, exact meshes"
    if args.write:
        _updated_srdf(robot, {}, origin)  # raises before the computation if the file cannot be changed
    bar = ProgressBar("self collisions", sys.stderr)
    verdicts = find_verdicts(robot.model, hands_of(robot.model), args.samples, args.seed, bar.show)
    disabled = {verdict.pair: verdict.reason for verdict in verdicts if verdict.reason}
    for pair, reason in robot.model.semantics.disabled_pairs.items():
        first, second = sorted(pair) if len(pair) == 2 else 2 * tuple(pair)
        if reason not in REASONS:
            disabled.setdefault((first, second), reason)
    if args.write:
        robot.srdf.write_text(_updated_srdf(robot, disabled, origin), encoding="utf-8")
    else:
        print(matrix_text(disabled), end="")
        _print_checked([verdict for verdict in verdicts if verdict.pair not in disabled])
    print(f"self collisions: {len(disabled)} of {len(verdicts)} pairs of links need no check", file=sys.stderr)
    return 0


def _load(folder: Path) -> LoadedRobot:
    """Reads the robot of a config package.

    Raises:
        CreationError: A file is missing or invalid.
    """
    faults = FaultList()
    package = read_config_package(folder, faults)
    urdf, srdf = (package_document(package, path, faults) for path in (package.urdf, package.srdf))
    if urdf is None or srdf is None or package.srdf is None:
        raise CreationError("\n".join(str(fault) for fault in faults.sorted_faults()))
    try:
        model = RobotModel(urdf.text, srdf.text, resolve=lambda uri: str(mesh_path(uri, find_package)))
    except PlanningError as error:
        raise CreationError(f"{folder}: {error}; check_config lists all faults") from error
    return LoadedRobot(model, package.srdf, srdf.text)


def _updated_srdf(robot: LoadedRobot, disabled: dict[tuple[str, str], str], origin: str) -> str:
    """Returns the SRDF text with a new matrix."""
    if robot.srdf.read_text(encoding="utf-8") != robot.srdf_text:
        raise CreationError(f"--write: {robot.srdf} is a xacro file; print the matrix and insert it yourself")
    try:
        return with_matrix(robot.srdf_text, disabled, origin)
    except MatrixError as error:
        raise CreationError(f"--write: {robot.srdf}: {error}") from error


def _print_checked(verdicts: Sequence[PairVerdict]) -> None:
    for verdict in verdicts:
        print(f"  <!-- checked: {verdict.pair[0]} {verdict.pair[1]} ({verdict.collision_fraction:.2%}) -->")
