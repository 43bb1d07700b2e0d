# SPDX-License-Identifier: BSD-3-Clause
"""The task constructor as a function and as the command ``state_machine_generator``."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from modular_framework_core.files import default_folders
from modular_framework_core.files.faults import TaskFault
from modular_framework_core.task_constructor import generator, task_graph
from modular_framework_core.task_constructor.explanation import explain, explain_template
from modular_framework_core.task_constructor.generator import GenerationError
from modular_framework_core.task_constructor.json_schema import task_schema
from modular_framework_core.task_constructor.known_names import KnownNames, PlannerNames, names_of_installation
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue, StateSourceError
from modular_framework_core.task_constructor.task_builder import load_task
from modular_framework_core.task_constructor.task_graph import FORMATS, GraphError
from modular_framework_core.task_constructor.task_spec import TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue
from modular_framework_ros.allowed_names import nearest


def check_task(
    script: Path,
    states_directories: Sequence[Path],
    templates_directories: Sequence[Path],
    known: KnownNames | None = None,
) -> TaskSpec:
    """Reads and checks a task without running or writing anything.

    Args:
        script: Path of the task's YAML file.
        states_directories: Directories with states, in search order.
        templates_directories: Directories with templates, in search order.
        known: Known names of messages, postures and planning groups.

    Raises:
        TaskFault: The task has faults; the exception carries all of them.
        FileNotFoundError: A directory does not exist.
    """
    return load_task(script, StateCatalogue(states_directories), TemplateCatalogue(templates_directories), known)


def construct_task(
    script: Path,
    states_directories: Sequence[Path],
    templates_directories: Sequence[Path],
    output: Path,
    *,
    known: KnownNames | None = None,
    file_name: str = "",
) -> tuple[TaskSpec, Path]:
    """Checks a task and generates its module, unless the existing module is up to date.

    Args:
        script: Path of the task's YAML file.
        states_directories: Directories with states, in search order.
        templates_directories: Directories with templates, in search order.
        output: Directory of the module.
        known: Known names of messages, postures and planning groups.
        file_name: File name with or without .py; "" for the task's name.

    Returns:
        The checked task and the path of the module.

    Raises:
        TaskFault: The task has faults; the exception carries all of them.
        FileNotFoundError: A directory does not exist.
        GenerationError: A template cannot be rendered, or the generated module does not compile.
    """
    task = check_task(script, states_directories, templates_directories, known)
    digest = generator.digest_line(task, templates_directories)
    target = generator.module_path(task, output, file_name)
    if not generator.is_up_to_date(target, digest):
        generator.write(task, generator.generate(task, templates_directories, digest), output, file_name)
    return task, target


def directories_from(text: str) -> list[Path]:
    """Splits a colon-separated list of directories, as in PATH."""
    return [Path(part).expanduser() for part in text.split(":") if part.strip()]


def main(arguments: Sequence[str], planners_of: Callable[[str], PlannerNames | None] = lambda package: None) -> int:
    """Runs the command ``state_machine_generator``.

    Args:
        arguments: Command-line arguments.
        planners_of: Function that returns the planners of a MoveIt configuration package, or None to skip the check of
            planners. The name "" means the package in the launch file of the API package.

    Returns:
        Exit code: 0 for success, 1 for a fault in the task or its inputs, 2 for a usage error.
    """
    parser = _parser()
    args = parser.parse_args([argument for argument in arguments if ":=" not in argument])
    if (args.explain or args.schema) and args.script is not None and str(args.script) != ".":
        args.states, args.templates = (
            directories_from(str(args.script)),
            args.states,
        )  # without a script, the first positional argument is the next parameter
    if args.script is None and not args.explain and not args.schema:
        parser.error("the script is missing; only --explain and --schema work without one")
    try:
        states = default_folders.states_folders(args.states or [])
        templates = default_folders.templates_folders(args.templates or [])
        catalogue = StateCatalogue(states)
        for folder in catalogue.empty_directories:
            print(no_states_in(folder), file=sys.stderr)
        if args.explain or args.schema:
            print(_about_language(args, catalogue, TemplateCatalogue(templates)))
            return 0
        script = default_folders.task_script(args.script)
        known = names_of_installation(args.config, args.moveit_config, args.description)
        known = known.with_planners(partial(planners_of, args.moveit_config))
        if args.check or args.graph:
            print(_draw_and_describe(args, check_task(script, states, templates, known)))
        else:
            output = args.output or generator.default_output_directory()
            print(construct_task(script, states, templates, output, known=known)[1])
    except (TaskFault, GenerationError, GraphError, StateSourceError, UnknownNameError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def no_states_in(folder: Path) -> str:
    """Returns the warning for a states directory without states."""
    return (
        f"states directory {folder} has no state: no .py file except those that begin with '_'; name the folder with "
        "your states, or omit it (the framework's own states are always available)"
    )


class UnknownNameError(Exception):
    """No state or template has the requested name."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="state_machine_generator",
        description="Checks a task constructor script and writes the state machine it describes.",
    )
    parser.add_argument("script", type=Path, nargs="?", help="the task, a YAML file")
    search_path = "separate several directories by ':'; the framework's own directory is searched last"
    parser.add_argument("states", type=directories_from, nargs="?", help=f"states directory; {search_path}")
    parser.add_argument("templates", type=directories_from, nargs="?", help=f"templates directory; {search_path}")
    parser.add_argument("output", type=Path, nargs="?", help="directory to write to (default: in $ROS_HOME)")
    parser.add_argument("--check", action="store_true", help="only check; write nothing")
    formats = ", ".join(f".{name}" for name in FORMATS)
    parser.add_argument("--graph", type=Path, metavar="FILE", help=f"check, and draw the task into a file ({formats})")
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FOLDER",
        help="folder with the named_*.yaml files of the task's messages (default: the API package's folder)",
    )
    parser.add_argument(
        "--moveit-config",
        metavar="PACKAGE",
        default="",
        help="MoveIt configuration package of the robot (default: from the API package's launch file)",
    )
    parser.add_argument(
        "--description",
        metavar="PACKAGE",
        default="",
        help="package with the models of the task's objects (default: from the API package's launch file)",
    )
    parser.add_argument("--explain", metavar="NAME", help="describe a state or template and its options")
    parser.add_argument("--schema", action="store_true", help="print the JSON Schema of tasks, for editors")
    return parser


def _draw_and_describe(args: argparse.Namespace, task: TaskSpec) -> str:
    """Draws a checked task if requested, and returns the message to print."""
    if args.graph:
        task_graph.write(task, args.graph)
        return str(args.graph)
    count = len(list(task.root.leaf_states()))
    return f"{args.script}: task '{task.name}' is in order, {count} state{'' if count == 1 else 's'}"


def _about_language(args: argparse.Namespace, states: StateCatalogue, templates: TemplateCatalogue) -> str:
    if args.schema:
        return json.dumps(task_schema(states, templates), indent=2)
    state, template = states.resolve(args.explain), templates.get(args.explain)
    if state is None and template is None:
        raise UnknownNameError(
            f"'{args.explain}' is neither a state nor a template; states: {', '.join(states.names())}; templates: "
            f"{', '.join(templates.names())}{nearest(args.explain, [*states.names(), *templates.names()])}"
        )
    pages = [] if state is None else [explain(states.get(state))]
    return "\n\n".join([*pages, *([] if template is None else [explain_template(template)])])
