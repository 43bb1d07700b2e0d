# SPDX-License-Identifier: BSD-3-Clause
"""Creates the packages of a robot from its URDF: ROBOT_robot and ROBOT_moveit_config.

The first contains the description and controllers, the second the planning configuration. On a terminal, the command
asks for confirmation of the detected parts; otherwise the options decide.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_setup.checks.package_check import check_package
from modular_framework_setup.commands.command import Command, add_sampling_arguments, check_sampling
from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_setup.creation.package_writer import refuse_existing, write_packages
from modular_framework_setup.creation.progress_bar import ProgressBar
from modular_framework_setup.creation.questions import ask_name, confirm_parts
from modular_framework_setup.creation.robot_parts import RobotParts
from modular_framework_setup.creation.robot_plan import Choices, RobotPlan, make_plan
from modular_framework_setup.creation.source_urdf import read_source
from modular_framework_setup.errors import CreationError
from modular_framework_urdf import xml_text

_NAME = re.compile(r"[a-z][a-z0-9_]*")


def main(arguments: Sequence[str] | None = None) -> int:
    """Creates the packages of a robot and returns the exit code."""
    return Command("create_robot", __doc__, _add_arguments, _create).run(arguments)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("urdf", type=Path, help="URDF or xacro file")
    parser.add_argument("arguments", nargs="*", metavar="NAME:=VALUE", help="arguments of the xacro file")
    parser.add_argument("--name", help="robot name for the package names; default: the name in the URDF")
    parser.add_argument("--into", type=Path, default=Path(), help="parent folder of the packages; default: this folder")
    parser.add_argument(
        "--arm",
        nargs=2,
        action="append",
        default=[],
        metavar=("BASE", "TIP"),
        help="links of an arm; repeat for each arm; default: found in the URDF",
    )
    parser.add_argument(
        "--gripper", nargs="+", action="append", default=[], metavar="LINK",
        help="links of the fingers; repeat for each gripper; default: found by mimic joints and pairs of equal joints",
    )  # fmt: skip
    add_sampling_arguments(parser)
    parser.add_argument("--author", default="maintainer", help="maintainer in package.xml")
    parser.add_argument("--email", default="maintainer@example.com", help="maintainer's address in package.xml")
    parser.add_argument("--yes", action="store_true", help="do not ask; accept the detected parts")


def _create(args: argparse.Namespace) -> int:
    if not args.urdf.is_file():
        raise CreationError(f"{args.urdf} is not a file; give the path of a URDF or xacro file")
    check_sampling(args)
    interactive = not args.yes and sys.stdin.isatty()
    choices = Choices(
        name=_name(args, interactive), chains=[tuple(chain) for chain in args.arm], fingers=args.gripper,
        samples=args.samples, seed=args.seed, author=args.author, email=args.email,
    )  # fmt: skip
    refuse_existing(args.into, (choices.robot_package, choices.config_package))
    source = read_source(args.urdf, _mappings(args.arguments), choices.robot_package)
    bar = ProgressBar("self collisions", sys.stderr)

    def confirm(tree: RobotTree, parts: RobotParts) -> RobotParts:
        return confirm_parts(tree, parts, choices) if interactive else parts

    plan = make_plan(source, choices, confirm, bar.show)
    folders = write_packages(plan, args.into)
    _report(plan, folders)
    faults = check_package(folders[1])
    for fault in faults:
        print(fault)
    return 1 if faults else 0


def _mappings(arguments: Sequence[str]) -> dict[str, str]:
    pairs = [argument.partition(":=") for argument in arguments]
    invalid = [name for name, sign, _ in pairs if not sign]
    if invalid:
        raise CreationError(f"got '{invalid[0]}'; write arguments of the xacro file as NAME:=VALUE")
    return {name: value for name, _, value in pairs}


def _name(args: argparse.Namespace, interactive: bool) -> str:
    name = args.name or _name_in(args.urdf)
    if not args.name and interactive:
        name = ask_name(name)
    if not _NAME.fullmatch(name):
        raise CreationError(f"--name is '{name}'; allowed: lower-case letters, digits and '_', a letter first")
    return str(name)


def _name_in(path: Path) -> str:
    """Returns the robot name in the URDF, converted to a valid package name."""
    try:
        name = xml_text.read(path).get("name", "")
    except (OSError, xml_text.XmlError):
        name = ""
    return (
        re.sub(r"^[^a-z]+|_+$", "", re.sub(r"[^a-z0-9]+", "_", (name or path.name.partition(".")[0]).lower()))
        or "robot"
    )


def _report(plan: RobotPlan, folders: Sequence[Path]) -> None:
    for arm in plan.parts.arms:
        hand = f", gripper {arm.gripper}" if arm.gripper else ""
        print(f"{arm.name}: {arm.base} -> {arm.tip}, joints {', '.join(arm.joints)}{hand}")
    for gripper in plan.parts.grippers:
        print(f"{gripper.name}: on {gripper.palm}, driven by {gripper.driver}, fingers {', '.join(gripper.links)}")
    disabled = sum(bool(verdict.reason) for verdict in plan.verdicts)
    print(f"self collisions: {disabled} of {len(plan.verdicts)} pairs of links need no check")
    for note in plan.notes:
        print(f"note: {note}")
    print(f"created {folders[0]} and {folders[1]}; start with")
    folder = folders[0].resolve().parent
    paths = [Path(path).resolve() for path in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if path]
    if not any(folder.is_relative_to(path) for path in paths):
        print(f"    export ROS_PACKAGE_PATH={folder}:$ROS_PACKAGE_PATH")
    print(f"    roslaunch {plan.choices.config_package} demo.launch")
