# SPDX-License-Identifier: BSD-3-Clause
"""The command `doctor`: checks the installation, the configuration and the running system, and says what is wrong."""

from __future__ import annotations

import argparse
import contextlib
import io
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import rosgraph
import roslaunch.core
import roslaunch.rlutil
import rospkg
import rospy

from modular_framework_core.diagnosis.findings import (
    Finding,
    Section,
    fault,
    has_faults,
    note,
    ok,
    section_text,
    without_private_data,
)
from modular_framework_core.diagnosis.installation import computer_lines, find_checkout, installation_findings
from modular_framework_core.diagnosis.ros_running_system import is_master_running, running_findings
from modular_framework_core.launching.launch_arguments import ArgumentError, check_arguments, load_error_text

LAUNCH_FILE = "start_framework.launch"
DEFAULT_PACKAGE = "modular_framework_api"
EXIT_FAULTS = 1


def main(arguments: Sequence[str], configuration_faults: Callable[[str, list[str]], Sequence[str]]) -> int:
    """Prints the findings; returns 1 if there is a fault.

    Args:
        arguments: Arguments of the command line.
        configuration_faults: Function that returns the faults of a launch file with its arguments.
    """
    parser = argparse.ArgumentParser(
        prog="doctor", description="Checks installation, configuration and running nodes; changes nothing."
    )
    parser.add_argument(
        "launch", nargs="*", metavar="[PACKAGE] [ARG:=VALUE ...]", help=f"package of {LAUNCH_FILE}, and its arguments"
    )
    parser.add_argument("--report", type=Path, metavar="FILE", help="write the findings for an issue report")
    options = parser.parse_args(arguments)
    launch_arguments = list(options.launch)
    package = launch_arguments.pop(0) if launch_arguments and "=" not in launch_arguments[0] else DEFAULT_PACKAGE
    checkout = find_checkout(Path(rospkg.RosPack().get_path(DEFAULT_PACKAGE)))
    sections = []
    for title, findings in (
        ("Installation", installation_findings(checkout, Path(rospkg.get_ros_home()))),
        (
            f"Configuration: {' '.join([LAUNCH_FILE, 'of', package, *launch_arguments])}",
            _configuration(package, launch_arguments, configuration_faults),
        ),
        (f"Running system: ROS master {rosgraph.get_master_uri()}", _running_system()),
    ):
        section = Section(title, list(findings))
        print(section_text(section), flush=True)
        sections.append(section)
    if options.report:
        text = "\n".join([*computer_lines(checkout), *map(section_text, sections)])
        options.report.write_text(without_private_data(text) + "\n")
        print(f"The report is in {options.report}. It names no user, host or address; read it before you publish it.")
    return EXIT_FAULTS if has_faults(sections) else 0


def _configuration(
    package: str, arguments: list[str], configuration_faults: Callable[[str, list[str]], Sequence[str]]
) -> Iterator[Finding]:
    """Yields the findings about a launch file, its arguments and its configuration files."""
    path = ""
    try:
        path = roslaunch.rlutil.resolve_launch_arguments([package, LAUNCH_FILE])[0]
        check_arguments(path, arguments)
        with contextlib.redirect_stdout(io.StringIO()):  # the messages of xacro
            faults = configuration_faults(path, arguments)
    except ArgumentError as error:
        faults = error.faults
    except (roslaunch.core.RLException, rospkg.ResourceNotFound) as error:
        faults = [load_error_text(error, path, arguments)]
    for text in faults:
        yield fault(
            text if text.endswith((".", "?")) else f"{text}.",
            "correct the configuration; the message states what is allowed",
            "start",
        )
    if not faults:
        yield ok("The launch file, its arguments, its configuration files and the MoveIt config package have no fault.")


def _running_system() -> Iterator[Finding]:
    """Yields the findings about the running nodes."""
    if not is_master_running():
        yield note(
            "No ROS master runs there, so there are no nodes to check.",
            f"start the framework, or set ROS_MASTER_URI (now {os.environ.get('ROS_MASTER_URI', 'not set')})",
        )
        return
    rospy.init_node("doctor", anonymous=True, disable_signals=True, disable_rosout=True)
    yield from running_findings()
