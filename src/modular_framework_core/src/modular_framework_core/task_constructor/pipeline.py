# SPDX-License-Identifier: BSD-3-Clause
"""The task constructor as one function, and its command line."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_core.files import default_folders
from modular_framework_core.files.faults import TaskFault, nearest
from modular_framework_core.task_constructor import generator, task_graph
from modular_framework_core.task_constructor.explanation import explain, explain_template
from modular_framework_core.task_constructor.generator import GenerationError
from modular_framework_core.task_constructor.json_schema import task_schema
from modular_framework_core.task_constructor.known_names import KnownNames, names_of_installation
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue, StateSourceError
from modular_framework_core.task_constructor.task_builder import load_task
from modular_framework_core.task_constructor.task_graph import FORMATS, GraphError
from modular_framework_core.task_constructor.task_spec import TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue


def check_task(
    script: Path,
    states_directories: Sequence[Path],
    templates_directories: Sequence[Path],
    known: KnownNames | None = None,
) -> TaskSpec:
    """Reads and checks a task; nothing is run or written.

    Args:
        script: The task.
        states_directories: Where its states are, in order.
        templates_directories: Where its templates are, in order.
        known: Names of messages and postures there are, as far as that is known.

    Raises:
        TaskFault: Something is wrong with the task; carries all faults.
        FileNotFoundError: One of the directories is not there.
    """
    return load_task(script, StateCatalogue(states_directories), TemplateCatalogue(templates_directories), known)


def construct_task(
    script: Path,
    states_directories: Sequence[Path],
    templates_directories: Sequence[Path],
    output: Path,
    known: KnownNames | None = None,
    file_name: str = "",
) -> tuple[TaskSpec, Path]:
    """Checks a task and writes its module into the directory ``output``; returns the task and the path of the module.

    A module that is there already is kept when nothing it was made from has changed. The file has the task's name, or
    ``file_name``.

    Raises:
        TaskFault, FileNotFoundError: As ``check_task``.
        GenerationError: A template is at fault.
    """
    task = check_task(script, states_directories, templates_directories, known)
    digest = generator.digest_line(task, templates_directories)
    target = generator.module_path(task, output, file_name)
    if not generator.is_up_to_date(target, digest):
        generator.write(task, generator.generate(task, templates_directories, digest), output, file_name)
    return task, target


def directories_from(text: str) -> list[Path]:
    """Splits a setting that names one or several directories, separated by ``:`` as in PATH."""
    return [Path(part).expanduser() for part in text.split(":") if part.strip()]


def main(arguments: Sequence[str]) -> int:
    """Runs the command ``state_machine_generator``.

    Returns:
        0 when what was asked for was done; 1 when the task (or what it needs) is at fault; 2 for a wrong command.
    """
    parser = _parser()
    given = parser.parse_args([argument for argument in arguments if ":=" not in argument])
    if (given.explain or given.schema) and given.script is not None and str(given.script) != ".":
        given.states, given.templates = directories_from(str(given.script)), given.states  # there is no script
    if given.script is None and not given.explain and not given.schema:
        parser.error("the script is missing; only --explain and --schema work without one")
    try:
        states = default_folders.states_folders(given.states or [])
        templates = default_folders.templates_folders(given.templates or [])
        catalogue = StateCatalogue(states)
        for folder in catalogue.empty_directories:
            print(no_states_in(folder), file=sys.stderr)
        if given.explain or given.schema:
            print(_about_language(given, catalogue, TemplateCatalogue(templates)))
            return 0
        script = default_folders.task_script(given.script)
        known = names_of_installation(given.config, given.moveit_config)
        if given.check or given.graph:
            print(_checked(given, check_task(script, states, templates, known)))
        else:
            output = given.output or generator.default_output_directory()
            print(construct_task(script, states, templates, output, known)[1])
    except (TaskFault, GenerationError, GraphError, StateSourceError, UnknownNameError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def no_states_in(folder: Path) -> str:
    """Says that a folder of states has none."""
    return (
        f"states directory {folder} has no state: no .py file but those that begin with '_'; name the folder that "
        "has your states, or leave it out (the framework's own states are found without it)"
    )


class UnknownNameError(Exception):
    """There is no state or template of that name; says which there are."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="state_machine_generator",
        description="Checks a task constructor script and writes the state machine it describes.",
    )
    parser.add_argument("script", type=Path, nargs="?", help="the task, a YAML file")
    several = "several are separated by ':'; the framework's own are found after them"
    parser.add_argument("states", type=directories_from, nargs="?", help=f"directory of the states; {several}")
    parser.add_argument("templates", type=directories_from, nargs="?", help=f"directory of the templates; {several}")
    parser.add_argument("output", type=Path, nargs="?", help="directory to write to (default: in $ROS_HOME)")
    parser.add_argument("--check", action="store_true", help="only check; write nothing")
    formats = ", ".join(f".{name}" for name in FORMATS)
    parser.add_argument("--graph", type=Path, metavar="FILE", help=f"check, and draw the task into a file ({formats})")
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FOLDER",
        help="folder whose named_*.yaml have the names a task may use (default: the API package's)",
    )
    parser.add_argument(
        "--moveit-config",
        metavar="PACKAGE",
        default="",
        help="MoveIt configuration package of the robot (default: the API package's launch file's)",
    )
    parser.add_argument("--explain", metavar="NAME", help="say what a state or template does and takes")
    parser.add_argument("--schema", action="store_true", help="print the JSON Schema of tasks, for editors")
    return parser


def _checked(given: argparse.Namespace, task: TaskSpec) -> str:
    """Draws a checked task where asked to; returns the message."""
    if given.graph:
        task_graph.write(task, given.graph)
        return str(given.graph)
    count = len(list(task.root.leaf_states()))
    return f"{given.script}: task '{task.name}' is in order, {count} state{'' if count == 1 else 's'}"


def _about_language(given: argparse.Namespace, states: StateCatalogue, templates: TemplateCatalogue) -> str:
    if given.schema:
        return json.dumps(task_schema(states, templates), indent=2)
    state, template = states.resolve(given.explain), templates.get(given.explain)
    if state is None and template is None:
        raise UnknownNameError(
            f"'{given.explain}' is no state and no template; states: {', '.join(states.names())}; templates: "
            f"{', '.join(templates.names())}{nearest(given.explain, [*states.names(), *templates.names()])}"
        )
    pages = [] if state is None else [explain(states.get(state))]
    return "\n\n".join([*pages, *([] if template is None else [explain_template(template)])])
