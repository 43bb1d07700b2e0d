# SPDX-License-Identifier: BSD-3-Clause
"""Command `mbf` of the wheel, which needs no ROS: `mbf report`, `mbf compare` and `mbf export`."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

COMMANDS = {
    "report": "reports an experiment: a result database, or a CSV table of your own",
    "compare": "compares two experiments: result databases or CSV tables",
    "export": "exports an experiment of a result database as CSV, Parquet or a LeRobot dataset",
}
EXIT_USAGE = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command.

    Args:
        arguments: Name of the command and its arguments; None for the arguments of the process.

    Returns:
        Exit code of the command, or 2 for an unknown command.
    """
    name, *rest = list(sys.argv[1:] if arguments is None else arguments) or [""]
    if name in COMMANDS:
        command = importlib.import_module(f"modular_framework_benchmark.commands.{name}_command")
        return int(command.main(rest))
    usage = ["usage: mbf COMMAND ...", "", *(f"  {key:8} {text}" for key, text in COMMANDS.items())]
    usage += ["", "mbf COMMAND --help lists the options of a command."]
    is_help = name in ("-h", "--help", "help")
    if name and not is_help:
        usage.append(f"error: got '{name}'; allowed: {', '.join(COMMANDS)}")
    print("\n".join(usage), file=sys.stdout if is_help else sys.stderr)
    return 0 if is_help else EXIT_USAGE
