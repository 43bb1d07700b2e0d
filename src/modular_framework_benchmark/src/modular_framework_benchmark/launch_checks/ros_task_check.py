# SPDX-License-Identifier: BSD-3-Clause
"""Checks the task of a launch once for all levels of an experiment, and finds the names that it does not use.

Parameters of planners, pipelines and regions that no state and no node uses change nothing in the episodes.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from modular_framework_benchmark.predicates.conditions import REGIONS
from modular_framework_core.files import default_folders
from modular_framework_core.files.faults import TaskFault
from modular_framework_core.launching.ros_declared_names import DeclaredNames, LaunchFault
from modular_framework_core.launching.ros_launch_preview import LaunchPreview
from modular_framework_core.task_constructor import pipeline
from modular_framework_core.task_constructor.known_names import MODEL, PLANNER, KnownNames, PlannerNames
from modular_framework_core.task_constructor.option_use_checks import names_made, names_used, texts_used
from modular_framework_planning.errors import ModelError
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_pipeline.planner_registry import (
    PlannerRegistry,
    ResolvedPlanner,
    UnknownNameError,
)
from modular_framework_planning.planning_pipeline.plugins import make_adapters, planner_class

PLANNER_CONFIGS = "planner_configs"
PACKAGES_WITHOUT_NAMES = ("controller_manager", "modular_framework_core", "robot_state_publisher", "rviz", "tf2_ros")
"""Packages with nodes without a declaration that use neither planners nor regions."""
FRAMEWORK_PLUGINS = "modular_framework_planning."
"""Start of the modules of the framework's planners and request adapters, which read only the settings of a planner."""


@dataclass(frozen=True, slots=True)
class CheckedTask:
    """Result of the check of a task.

    Attributes:
        faults: Faults of the task.
        planners: Planners that the states of a task without faults name.
        models: Models that the states of the task spawn, and models that the task declares in `external_names`.
        texts: Names and other texts in the options of the states of a task without faults.
        has_own_states: Whether a state is not the framework's, and may use names that its options do not contain.
    """

    faults: tuple[LaunchFault, ...] = ()
    planners: tuple[str, ...] = ()
    models: frozenset[str] = frozenset()
    texts: frozenset[str] = frozenset()
    has_own_states: bool = False


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
    framework = default_folders.states_folder().resolve()
    return CheckedTask(
        planners=names_used(task.root, PLANNER),
        models=names_made(task.root, MODEL) | task.external_names.get(MODEL, frozenset()),
        texts=texts_used(task.root),
        has_own_states=any(state.source.file.parent != framework for state in task.root.leaf_states()),
    )


@dataclass(frozen=True, slots=True)
class UnusedNames:
    """Planners, pipelines and regions that no state and no node of a launch uses.

    Attributes:
        launch: Nodes and parameters of the launch.
        names: Declared parameters of the launch.
        registry: Planners of the launch; None without a move_group node.
        pipelines: Whole name of planning_pipelines, with a slash at the end.
        task: Task of the launch; None if it is unknown, such as a state machine in a file.
        extra: Parameters that nodes of the user read, and that therefore always have an effect.
    """

    launch: LaunchPreview
    names: DeclaredNames
    registry: PlannerRegistry | None
    pipelines: str
    task: CheckedTask | None
    extra: Container[str] = ()

    def reasons(self) -> dict[str, str]:
        """Returns the parameters without effect, and the reason as the end of a sentence."""
        reasons = dict.fromkeys(self.names.without_effect(), "has no effect")
        if self._are_uses_known:
            reasons |= self._unused_regions()
            reasons |= self._unused_pipelines()
        return {name: reason for name, reason in reasons.items() if name not in self.extra}

    def effective(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Returns the parameters with an effect; the used planners with their settings replace the configurations.

        Args:
            parameters: Parameters of the launch with their defaults, by resolved name.
        """
        reasons = self.reasons()
        kept = {name: value for name, value in parameters.items() if name not in reasons and (name != REGIONS or value)}
        if not self._are_uses_known or self.registry is None:
            return kept
        configurations = tuple(
            f"{self.pipelines}{name}/{PLANNER_CONFIGS}/"
            for name, spec in self.registry.specs.items()
            if has_framework_plugins(spec)
        )
        kept = {
            name: value for name, value in kept.items() if not name.startswith(configurations) or name in self.extra
        }
        return {**kept, "planners": sorted(map(repr, self._used_planners()))}

    def _used_planners(self) -> list[ResolvedPlanner]:
        """Returns the planners that the task uses, and the default planner."""
        if self.registry is None:
            return []
        named = {value for _, value in self.names.naming("planner")}
        if self.task is not None:
            known = PlannerNames(self.registry.by_pipeline())
            named |= {text for text in self.task.texts | {*self.task.planners} if text in known}
        return list(self._resolved(self.registry, {"", *named}))

    @property
    def _are_uses_known(self) -> bool:
        """Returns whether all names are known that states and nodes use; code of the user may use further names."""
        own_nodes = [node for node in self.names.undeclared if node.package not in PACKAGES_WITHOUT_NAMES]
        return self.task is not None and not self.task.has_own_states and not own_nodes

    def _unused_regions(self) -> Iterator[tuple[str, str]]:
        used = self.task.texts if self.task is not None else ()
        for name in self.launch.parameters:
            region = name.removeprefix(f"{REGIONS}/").split("/")[0]
            if name.startswith(f"{REGIONS}/") and region not in used:
                yield name, f"belongs to the region '{region}', which the task does not use"

    def _unused_pipelines(self) -> Iterator[tuple[str, str]]:
        if self.registry is None:
            return
        planners = self._used_planners()
        texts = self.task.texts if self.task is not None else frozenset()
        used = {self.registry.default, *(item.pipeline for item in planners), *(texts & {*self.registry.specs})}
        for name in self.launch.parameters:
            if not name.startswith(self.pipelines):
                continue
            pipeline, _, key = name.removeprefix(self.pipelines).partition("/")
            key, _, setting = key.partition("/")
            if pipeline not in used and key != "capabilities":
                yield name, f"belongs to the pipeline '{pipeline}', which the task does not use"
            elif key == PLANNER_CONFIGS and setting and has_framework_plugins(self.registry.specs[pipeline]):
                yield from self._unused_planner(name, pipeline, setting.split("/")[0], planners)

    def _unused_planner(
        self, name: str, pipeline: str, configuration: str, planners: Collection[ResolvedPlanner]
    ) -> Iterator[tuple[str, str]]:
        """Yields a setting of a planner that the task does not use."""
        assert self.registry is not None
        for planner in self._resolved(self.registry, [f"{pipeline}/{configuration}"]):
            if planner not in planners:
                yield name, f"belongs to the planner '{configuration}', which the task does not use"

    def _resolved(self, registry: PlannerRegistry, names: Collection[str]) -> Iterator[ResolvedPlanner]:
        group = str(self.launch.parameters.get("/arm_group_name", ""))
        for name in sorted(names):
            try:
                yield registry.resolve(name, group)
            except (UnknownNameError, ModelError):
                continue


def has_framework_plugins(spec: PipelineSpec) -> bool:
    """Returns whether planner and adapters of a pipeline are the framework's; other plugins may read any parameter."""
    try:
        kinds = [planner_class(spec.planner), *map(type, make_adapters(spec.adapters))]
    except ModelError:
        return True  # move_group skips the pipeline
    return all(kind.__module__.startswith(FRAMEWORK_PLUGINS) for kind in kinds)
