# SPDX-License-Identifier: BSD-3-Clause
"""Checks the task of a launch once, although every level of an experiment has the same task."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from modular_framework_core.files import default_folders
from modular_framework_core.files.faults import TaskFault
from modular_framework_core.launching.ros_declared_names import LaunchFault
from modular_framework_core.task_constructor import pipeline
from modular_framework_core.task_constructor.known_names import PLANNER, KnownNames
from modular_framework_core.task_constructor.option_use_checks import names_used


@dataclass(frozen=True, slots=True)
class CheckedTask:
    """Result of the check of a task.

    Attributes:
        faults: Faults of the task.
        planners: Planners that the states of a task without faults name.
    """

    faults: tuple[LaunchFault, ...] = ()
    planners: tuple[str, ...] = ()


class CacheableNames:
    """Hashable names that a task may use, as a cache key of the task check."""

    def __init__(self, names: KnownNames) -> None:
        self.names = names
        kinds = {**names.names, PLANNER: names.planners() or ()}
        self._content = repr(sorted((kind, sorted(known)) for kind, known in kinds.items()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CacheableNames) and self._content == other._content

    def __hash__(self) -> int:
        return hash(self._content)


@lru_cache(maxsize=64)
def checked_task(
    script: str, states: tuple[Path, ...], templates: tuple[Path, ...], known: CacheableNames
) -> CheckedTask:
    """Checks a task; the cache assumes that its files do not change while an experiment is read.

    Args:
        script: Path of the task, or its name in the API package.
        states: Folders with states besides the framework's.
        templates: Folders with templates besides the framework's.
        known: Names that the task may use.
    """
    try:
        task = pipeline.check_task(
            default_folders.task_script(Path(script)),
            default_folders.states_folders(states),
            default_folders.templates_folders(templates),
            known.names,
        )
    except TaskFault as error:
        return CheckedTask(tuple(LaunchFault("", f"the task: {fault}", "task") for fault in error.faults))
    except (OSError, ValueError) as error:
        return CheckedTask((LaunchFault("", f"the task cannot be read: {error}", "task"),))
    return CheckedTask(planners=names_used(task.root, PLANNER))
