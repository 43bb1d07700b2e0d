# SPDX-License-Identifier: BSD-3-Clause
"""Launches the stack of an episode: a launch file with parameters set over its own.

    python3 -m modular_framework_benchmark.episodes.ros_stack_launcher PACKAGE FILE PARAMETERS_FILE [name:=value ...]

It runs until it is stopped or a node dies, and says last which one and why. The process that started it kills the nodes
that are left.
"""

from __future__ import annotations

import sys
from pathlib import Path

from modular_framework_core.launching.launch_runner import run_launch_file

if __name__ == "__main__":
    package, launch_file, parameters, *arguments = sys.argv[1:]
    # the task waits for its start and does not end by itself: its end is a death like that of any node
    later_files = [Path(parameters)]
    sys.exit(run_launch_file(package, launch_file, arguments, "", later_files, leaves_nodes=True))
