# SPDX-License-Identifier: BSD-3-Clause
"""What the commands of this package share: the way from arguments to the exit code, and arguments of sampling."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from modular_framework_planning.errors import PlanningError
from modular_framework_setup.errors import CreationError, SetupError

SAMPLES = 10_000
"""Random states for a collision matrix, unless a command is given another number."""


@dataclass(frozen=True, slots=True)
class Command:
    """A command of the terminal.

    Attributes:
        name: of the program.
        description: for its help; None for none.
        add_arguments: adds its arguments to a parser.
        work: does it and returns the exit code. A SetupError, PlanningError or OSError of it is printed and makes the
            exit code 1.
    """

    name: str
    description: str | None
    add_arguments: Callable[[argparse.ArgumentParser], None]
    work: Callable[[argparse.Namespace], int]

    def run(self, arguments: Sequence[str] | None) -> int:
        """Runs it with arguments, None for those of the program; returns the exit code."""
        parser = argparse.ArgumentParser(prog=self.name, description=self.description)
        self.add_arguments(parser)
        given = parser.parse_args(arguments)
        try:
            return self.work(given)
        except (SetupError, PlanningError, OSError) as error:
            print(f"{self.name}: {error}", file=sys.stderr)
            return 1


def add_sampling_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds how many states a collision matrix is computed from, and their seed."""
    parser.add_argument("--samples", type=int, default=SAMPLES, help=f"random states; default: {SAMPLES}")
    parser.add_argument("--seed", type=int, default=1, help="of the random states; default: 1")


def check_sampling(given: argparse.Namespace) -> None:
    """Checks what was given for the arguments of sampling.

    Raises:
        CreationError: a value is not allowed.
    """
    if given.samples < 1:
        raise CreationError(f"--samples is {given.samples}; allowed: 1 or more, {SAMPLES} is usual")
