# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the names in the framework's launch if users start plain roslaunch; the command of a launch parameter."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from modular_framework_core.launching import ros_argument_check


def name_faults(files: Sequence[str], arguments: list[str]) -> list[str]:
    """Returns all faults in the names of launch files, their arguments and their configuration files."""
    # the import takes 0.4 s, and only plain roslaunch needs it: run_framework has resolved the names
    from modular_framework_benchmark.launch_checks.ros_launch_check import launch_faults

    return launch_faults(files[0], arguments, files[1:])


if __name__ == "__main__":
    sys.exit(ros_argument_check.main(sys.argv[1:], name_faults))
