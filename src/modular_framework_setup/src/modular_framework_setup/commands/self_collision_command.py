# SPDX-License-Identifier: BSD-3-Clause
"""Computes which pairs of links of a robot need no collision check, for the SRDF of a config package.

The reasons are those of the MoveIt Setup Assistant, found on the exact shapes. The package may be of MoveIt 1 or
MoveIt 2.
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
        model: of URDF and SRDF.
        srdf: file of the SRDF.
        srdf_text: with xacro expanded.
    """

    model: RobotModel
    srdf: Path
    srdf_text: str


def main(arguments: Sequence[str] | None = None) -> int:
    """Computes the collision matrix of a config package, and prints or writes it; returns 0, or 1 when it could not."""
    return Command("compute_self_collisions", __doc__, _add_arguments, _compute).run(arguments)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("package", help="a ROS package, or a folder; it need not be built")
    add_sampling_arguments(parser)
    parser.add_argument("--write", action="store_true", help="replace the matrix in the SRDF; default: print it")


def _compute(given: argparse.Namespace) -> int:
    check_sampling(given)
    folder = folder_of(given.package)
    with packages_beside(folder):
        robot = _load(folder)
    made = f"{given.samples} random states, seed {given.seed}, exact meshes"
    if given.write:
        _changed(robot, {}, made)  # refuses a file that cannot take a matrix before the work
    bar = ProgressBar("self collisions", sys.stderr)
    verdicts = find_verdicts(robot.model, hands_of(robot.model), given.samples, given.seed, bar.show)
    disabled = {verdict.pair: verdict.reason for verdict in verdicts if verdict.reason}
    for pair, reason in robot.model.semantics.disabled_pairs.items():
        one, other = sorted(pair) if len(pair) == 2 else 2 * tuple(pair)
        if reason not in REASONS:
            disabled.setdefault((one, other), reason)
    if given.write:
        robot.srdf.write_text(_changed(robot, disabled, made), encoding="utf-8")
    else:
        print(matrix_text(disabled), end="")
        _print_checked([verdict for verdict in verdicts if verdict.pair not in disabled])
    print(f"self collisions: {len(disabled)} of {len(verdicts)} pairs of links need no check", file=sys.stderr)
    return 0


def _load(folder: Path) -> LoadedRobot:
    """Reads the robot of a config package.

    Raises:
        CreationError: a file is missing or cannot be used.
    """
    faults = FaultList()
    package = read_config_package(folder, faults)
    urdf, srdf = (package_document(package, path, faults) for path in (package.urdf, package.srdf))
    if urdf is None or srdf is None or package.srdf is None:
        raise CreationError("\n".join(str(fault) for fault in faults.sorted()))
    try:
        model = RobotModel(urdf.text, srdf.text, resolve=lambda uri: str(mesh_path(uri, find_package)))
    except PlanningError as error:
        raise CreationError(f"{folder}: {error}; check_config lists all faults") from error
    return LoadedRobot(model, package.srdf, srdf.text)


def _changed(robot: LoadedRobot, disabled: dict[tuple[str, str], str], made: str) -> str:
    """Returns the text of the SRDF with another matrix."""
    if robot.srdf.read_text(encoding="utf-8") != robot.srdf_text:
        raise CreationError(f"--write: {robot.srdf} is a xacro file; print the matrix, and put it where it belongs")
    try:
        return with_matrix(robot.srdf_text, disabled, made)
    except MatrixError as error:
        raise CreationError(f"--write: {robot.srdf}: {error}") from error


def _print_checked(verdicts: Sequence[PairVerdict]) -> None:
    for verdict in verdicts:
        print(f"  <!-- checked: {verdict.pair[0]} {verdict.pair[1]} ({verdict.share:.2%}) -->")
