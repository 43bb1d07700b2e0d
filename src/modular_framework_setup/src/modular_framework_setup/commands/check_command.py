# SPDX-License-Identifier: BSD-3-Clause
"""The command `check_config`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_setup.checks.package_check import read_and_check
from modular_framework_setup.config_files.config_package import NoConfigPackageError, folder_of
from modular_framework_setup.page.robot_page import page_text


def main(arguments: Sequence[str] | None = None) -> int:
    """Checks a config package and prints its faults; returns 0 when it has none, else 1."""
    parser = argparse.ArgumentParser(
        prog="check_config",
        description="Says what is inconsistent in a config package before anything starts: URDF, SRDF, joint limits, "
        "kinematics, controllers, planning pipelines, sensors and launch files, of MoveIt 1 or MoveIt 2.",
    )
    parser.add_argument("package", help="a ROS package, or a folder; it need not be built")
    parser.add_argument("--html", type=Path, metavar="FILE", help="also write a page that shows the robot")
    given = parser.parse_args(arguments)
    try:
        folder = folder_of(given.package)
    except NoConfigPackageError as error:
        print(f"check_config: {error}", file=sys.stderr)
        return 1
    checked = read_and_check(folder)
    faults = checked.faults
    for fault in faults:
        print(fault)
    if given.html is not None:
        try:
            given.html.write_text(page_text(checked), encoding="utf-8")
        except OSError as error:
            print(f"check_config: --html: {error}; name a file that can be written", file=sys.stderr)
            return 1
    count = f"{len(faults)} fault{'' if len(faults) == 1 else 's'}" if faults else "no fault"
    print(f"check_config: {folder}: {count}", file=sys.stderr)
    return 1 if faults else 0
