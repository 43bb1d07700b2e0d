# SPDX-License-Identifier: BSD-3-Clause
"""Command `launch_py`, which runs a launch file or lists its arguments."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from launch.actions.grouping import IncludeLaunchDescription
from launch.actions.launch_description import LaunchDescription
from launch.actions.launch_file_sources import (
    AnyLaunchDescriptionSource,
    get_launch_description_from_any_launch_file,
)
from launch.core.errors import LaunchError, hint, listed
from launch.core.launch_context import LaunchContext
from launch.core.screen_log import get_logger
from launch.launch_service import EXIT_BAD_LAUNCH, LaunchService
from launch.ros_packages import package_share_directory
from launch.substitutions.text import described

ENDINGS = (".launch.py", ".launch", ".launch.xml")
USAGE = (
    "launch_py [--show-args] PACKAGE FILE [argument:=value ...]  |  launch_py [--show-args] PATH [argument:=value ...]"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a launch file to its end; returns the exit code, see `LaunchService.run`."""
    parser = argparse.ArgumentParser(prog="launch_py", usage=USAGE, description=main.__doc__)
    parser.add_argument("--show-args", "-s", action="store_true", help="only list the arguments of the file")
    parser.add_argument("words", nargs="+", help="package and file, or the path of a file; then argument:=value")
    parsed = parser.parse_args(arguments)
    try:
        path, values = _file_and_arguments(parsed.words)
        if parsed.show_args:
            print(argument_listing(get_launch_description_from_any_launch_file(str(path))))
            return 0
    except LaunchError as error:
        get_logger().error("%s", error)
        return EXIT_BAD_LAUNCH
    return run_launch_file(path, values)


def run_launch_file(path: Path, values: dict[str, str]) -> int:
    """Runs a launch file to its end.

    Args:
        path: Path of the launch file.
        values: Values of its arguments, by name.

    Returns:
        The exit code, see `LaunchService.run`.
    """
    include = IncludeLaunchDescription(AnyLaunchDescriptionSource(str(path)), launch_arguments=values)
    include.where = "launch_py"

    def check(context: LaunchContext) -> None:
        known = LaunchDescription([include]).get_launch_arguments()
        declared = context.declared_arguments | {argument.name for argument in known}
        unknown = [name for name in values if name not in declared | context.read_configurations]
        if unknown:
            raise LaunchError(
                f"{path} has no argument '{unknown[0]}'{hint(unknown[0], declared)}; allowed: {listed(declared)}; "
                "correct the name, or leave it out"
            )

    service = LaunchService(argv=[f"{name}:={value}" for name, value in values.items()], check=check)
    service.include_launch_description(LaunchDescription([include]))
    return service.run()


def _file_and_arguments(words: Sequence[str]) -> tuple[Path, dict[str, str]]:
    """Splits the words of a command line into the launch file and the values of its arguments."""
    first = next((index for index, word in enumerate(words) if ":=" in word), len(words))
    names, assignments = words[:first], words[first:]
    values: dict[str, str] = {}
    for assignment in assignments:
        name, separator, value = assignment.partition(":=")
        if not separator or not name:
            raise LaunchError(f"argument '{assignment}' does not have the form name:=value")
        values[name] = value
    match names:
        case [path] if Path(path).is_file():
            return Path(path).resolve(), values
        case [path, word, *_] if Path(path).is_file():
            raise LaunchError(f"argument '{word}' does not have the form name:=value; allowed: {USAGE}")
        case [package, file]:
            return file_of_package(package, file), values
        case [path] if "/" in path or path.endswith((".py", ".launch", ".xml")):
            raise LaunchError(f"file {Path(path).resolve()} does not exist; allowed: {USAGE}")
    raise LaunchError(f"got '{' '.join(names)}'; allowed: {USAGE}")


def file_of_package(package: str, file: str) -> Path:
    """Returns the path of a launch file in a package, in its folder `launch` or any other folder.

    Raises:
        LaunchError: The package or file does not exist, or several files have the name.
    """
    folder = Path(package_share_directory(package))
    if (folder / "launch" / file).is_file():
        return folder / "launch" / file
    paths = sorted(path for path in folder.rglob(Path(file).name) if path.is_file() and str(path).endswith(f"/{file}"))
    if len(paths) == 1:
        return paths[0]
    if paths:
        raise LaunchError(f"package '{package}' has several files {file}: {listed(map(str, paths))}; give a path")
    file_names = sorted({path.name for path in folder.rglob("*") if path.name.endswith(ENDINGS)})
    raise LaunchError(
        f"package '{package}' ({folder}) has no launch file '{file}'{hint(file, file_names)}; known: "
        f"{listed(file_names)}"
    )


def argument_listing(description: LaunchDescription) -> str:
    """Returns a listing of a description's arguments, with their descriptions and defaults."""
    lines = ["Arguments (pass arguments as '<name>:=<value>'):"]
    arguments = description.get_launch_arguments()
    for argument in arguments:
        lines += ["", f"    '{argument.name}':{'*' if argument.conditionally_included else ''}"]
        lines += [f"        {argument.description}"]
        if argument.default_value is not None:
            lines += [f"        (default: {described(argument.default_value)})"]
    if not arguments:
        lines += ["", "  No arguments."]
    if any(argument.conditionally_included for argument in arguments):
        lines += ["", "* argument(s) which are only used if specific conditions occur"]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
