# SPDX-License-Identifier: BSD-3-Clause
"""Common parts of the commands: argument parsing, error handling and sampling arguments."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from modular_framework_planning.errors import PlanningError
from modular_framework_setup.errors import CreationError, SetupError

SAMPLES = 10_000
"""Default number of random states for a collision matrix."""


@dataclass(frozen=True, slots=True)
class Command:
    """A command-line program.

    Attributes:
        name: Name of the program.
        description: Description for the help text, or None.
        add_arguments: Function that adds the arguments to a parser.
        execute: Function that runs the command and returns the exit code. A SetupError, PlanningError or OSError is
            printed, and the exit code is 1.
    """

    name: str
    description: str | None
    add_arguments: Callable[[argparse.ArgumentParser], None]
    execute: Callable[[argparse.Namespace], int]

    def run(self, arguments: Sequence[str] | None) -> int:
        """Runs the command with the given arguments, by default the arguments of the process; returns the exit code."""
        parser = argparse.ArgumentParser(prog=self.name, description=self.description)
        self.add_arguments(parser)
        args = parser.parse_args(arguments)
        try:
            return self.execute(args)
        except (SetupError, PlanningError, OSError) as error:
            print(f"{self.name}: {error}", file=sys.stderr)
            return 1


def add_sampling_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments for the number and the seed of random states."""
    parser.add_argument("--samples", type=int, default=SAMPLES, help=f"random states; default: {SAMPLES}")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random states; default: 1")


def check_sampling(args: argparse.Namespace) -> None:
    """Checks the sampling arguments.

    Raises:
        CreationError: A value is not allowed.
    """
    if args.samples < 1:
        raise CreationError(f"--samples is {args.samples}; allowed: 1 or more, {SAMPLES} is usual")
