# SPDX-License-Identifier: BSD-3-Clause
"""The task constructor in one call, and its command line."""
from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from modular_framework_core.task_constructor import default_folders, generator
from modular_framework_core.task_constructor.faults import TaskFault
from modular_framework_core.task_constructor.generator import GenerationError
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.task_builder import load_task
from modular_framework_core.task_constructor.task_spec import TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue


def check_task(script: Path, states_directories: Sequence[Path], templates_directories: Sequence[Path]) -> TaskSpec:
    """Read and check a task; nothing is run or written.

    Raises:
        TaskFault: something is wrong with the task; carries all faults.
        FileNotFoundError: one of the directories is not there.
    """
    return load_task(script, StateCatalogue(states_directories), TemplateCatalogue(templates_directories))


def construct_task(
    script: Path, states_directories: Sequence[Path], templates_directories: Sequence[Path], output: Path
) -> tuple[TaskSpec, Path]:
    """Check a task and write its module into the directory ``output``; return the task and the path of the module.

    Raises:
        TaskFault, FileNotFoundError: as ``check_task``.
        GenerationError: a template is at fault.
    """
    task = check_task(script, states_directories, templates_directories)
    text = generator.generate(task, templates_directories)
    return task, generator.write(task, text, output)


def directories_from(text: str) -> list[Path]:
    """Split a setting that names one or several directories, separated by ``:`` as in PATH."""
    return [Path(part).expanduser() for part in text.split(":") if part.strip()]


def main(arguments: Sequence[str]) -> int:
    """Run the command ``state_machine_generator``.

    Returns:
        0 when the task is in order (and written, unless only checked); 1 when it is not; 2 for a wrong command.
    """
    parser = argparse.ArgumentParser(
        prog="state_machine_generator",
        description="Checks a task constructor script and writes the state machine it describes.",
    )
    parser.add_argument("script", type=Path, help="the task, a YAML file")
    several = "several are separated by ':'; empty or left out: the framework's"
    parser.add_argument("states", type=directories_from, nargs="?", help=f"directory of the states; {several}")
    parser.add_argument("templates", type=directories_from, nargs="?", help=f"directory of the templates; {several}")
    parser.add_argument("output", type=Path, nargs="?", help="directory to write to (default: in $ROS_HOME)")
    parser.add_argument("--check", action="store_true", help="only check; write nothing")
    given = parser.parse_args([argument for argument in arguments if ":=" not in argument])
    try:
        states = given.states or [default_folders.states_folder()]
        templates = given.templates or [default_folders.templates_folder()]
        if given.check:
            task = check_task(given.script, states, templates)
            print(f"{given.script}: task '{task.name}' is in order, {len(list(task.root.leaf_states()))} states")
        else:
            output = given.output or generator.default_output_directory()
            _, path = construct_task(given.script, states, templates, output)
            print(path)
    except (TaskFault, GenerationError, FileNotFoundError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0
