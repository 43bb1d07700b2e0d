# SPDX-License-Identifier: BSD-3-Clause
"""Launches the stack of an episode: a launch file with overriding parameters.

    python3 -m modular_framework_benchmark.episodes.ros_stack_launcher PACKAGE FILE PARAMETERS_FILE [name:=value ...]

The program runs until it is stopped or a node dies; it then prints the node and the cause. The parent process kills the
remaining nodes.
"""

from __future__ import annotations

import sys
from pathlib import Path

from modular_framework_core.launching.launch_runner import LaunchSpec, run_launch

if __name__ == "__main__":
    package, launch_file, parameters, *arguments = sys.argv[1:]
    spec = LaunchSpec(package, launch_file, arguments, later_files=[Path(parameters)])
    # The task waits for its start and does not end, so the end of its node counts as a death.
    sys.exit(run_launch(spec, task_name="", leaves_nodes=True))
