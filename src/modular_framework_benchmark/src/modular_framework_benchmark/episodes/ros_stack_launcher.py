# SPDX-License-Identifier: BSD-3-Clause
"""Launches the stack of an episode: a launch file with overriding parameters.

    python3 -m modular_framework_benchmark.episodes.ros_stack_launcher PACKAGE FILE PARAMETERS NODES [name:=value ..]

NODES are the absolute names of the method's nodes, separated by commas. Each of them is started by `method_node`,
which keeps its descendants together.

The program runs until it is stopped or a node dies; it then prints the node and the cause. The parent process kills the
remaining nodes.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import roslaunch.core

from modular_framework_benchmark.episodes import method_node
from modular_framework_core.launching.launch_runner import LaunchSpec, run_launch


def start_by_method_node(node: roslaunch.core.Node) -> None:
    """Makes `method_node` start a node.

    Args:
        node: Node of a launch file.
    """
    command = shlex.join(method_node.COMMAND)
    if node.cwd == "node":  # roslaunch takes the folder of the first program
        command += f" {method_node.IN_ITS_FOLDER_OPTION}"
    node.launch_prefix = f"{command} {node.launch_prefix or ''}"


def main(arguments: list[str]) -> int:
    """Launches the stack; see the module."""
    package, launch_file, parameters, method_nodes, *launch_arguments = arguments
    names = method_nodes.split(",")

    def prepare_node(node: roslaunch.core.Node) -> None:
        if node.namespace + node.name in names:
            start_by_method_node(node)

    spec = LaunchSpec(package, launch_file, launch_arguments, later_files=[Path(parameters)])
    # The task waits for its start and does not end, so the end of its node counts as a death.
    return run_launch(spec, task_name="", leaves_nodes=True, prepare=prepare_node)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
