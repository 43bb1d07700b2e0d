# SPDX-License-Identifier: BSD-3-Clause
"""The command `check_config`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from modular_framework_setup.checks.package_check import check_package
from modular_framework_setup.config_files.config_package import NoConfigPackageError, folder_of


def main(arguments: Sequence[str] | None = None) -> int:
    """Checks a config package and prints its faults; returns 0 when it has none, else 1."""
    parser = argparse.ArgumentParser(
        prog="check_config",
        description="Says what is inconsistent in a config package before anything starts: URDF, SRDF, joint limits, "
        "kinematics, controllers, planning pipelines, sensors and launch files, of MoveIt 1 or MoveIt 2.",
    )
    parser.add_argument("package", help="a ROS package, or a folder; it need not be built")
    given = parser.parse_args(arguments)
    try:
        folder = folder_of(given.package)
    except NoConfigPackageError as error:
        print(f"check_config: {error}", file=sys.stderr)
        return 1
    faults = check_package(folder)
    for fault in faults:
        print(fault)
    count = f"{len(faults)} fault{'' if len(faults) == 1 else 's'}" if faults else "no fault"
    print(f"check_config: {folder}: {count}", file=sys.stderr)
    return 1 if faults else 0
