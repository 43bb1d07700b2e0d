# SPDX-License-Identifier: BSD-3-Clause
"""Reports all faults of a MoveIt 1 or MoveIt 2 config package before anything starts.

Checks URDF, SRDF, joint limits, kinematics, controllers, planning pipelines, sensors and launch files.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_setup.checks.package_check import read_and_check
from modular_framework_setup.commands.command import Command
from modular_framework_setup.config_files.config_package import folder_of
from modular_framework_setup.errors import SetupError
from modular_framework_setup.page.robot_page import page_text


def main(arguments: Sequence[str] | None = None) -> int:
    """Checks a config package, prints its faults and returns 1 if there are any, else 0."""
    return Command("check_config", __doc__, _add_arguments, _check).run(arguments)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("package", help="ROS package or folder, which need not be built")
    parser.add_argument("--html", type=Path, metavar="FILE", help="also write an HTML page about the robot")


def _check(args: argparse.Namespace) -> int:
    folder = folder_of(args.package)
    checked = read_and_check(folder)
    faults = checked.faults
    for fault in faults:
        print(fault)
    if args.html is not None:
        try:
            args.html.write_text(page_text(checked), encoding="utf-8")
        except OSError as error:
            raise SetupError(f"--html: {error}; name a writable file") from error
    count = f"{len(faults)} fault{'' if len(faults) == 1 else 's'}" if faults else "no fault"
    print(f"check_config: {folder}: {count}", file=sys.stderr)
    return 1 if faults else 0
