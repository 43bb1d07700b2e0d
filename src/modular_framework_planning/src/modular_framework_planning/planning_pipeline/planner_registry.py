# SPDX-License-Identifier: BSD-3-Clause
"""Planner registry: resolves the names of pipelines, planners and request adapters from parameters, without a node."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.planning_interface.planner_configurations import resolve_configuration, without_group
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec, pipelines_of, read_pipeline_spec
from modular_framework_planning.planning_pipeline.plugins import make_adapters, planner_class
from modular_framework_ros.allowed_names import listing, nearest


class UnknownNameError(Exception):
    """Raised for a name that does not exist.

    Attributes:
        what: Kind of the named item, such as "planner".
        name: Unknown name.
        known: Existing names.
    """

    def __init__(self, what: str, name: str, known: tuple[str, ...]) -> None:
        super().__init__(f"there is no {what} '{name}'; {listing(known)}{nearest(name, known)}")
        self.what, self.name, self.known = what, name, known


@dataclass(frozen=True, slots=True)
class ResolvedPlanner:
    """The pipeline, plugin and planner that a requested name refers to.

    Attributes:
        pipeline: Name of the pipeline.
        plugin: Parameter planning_plugin of the pipeline.
        planner: Name of the planner within the plugin.
        settings: Settings of the planner, keyed as in ompl_planning.yaml.
        adapters: Parameter request_adapters, outermost first.
    """

    pipeline: str
    plugin: str
    planner: str
    settings: Mapping[str, Any]
    adapters: str


class PlannerRegistry:
    """The pipelines that move_group would load.

    Args:
        node: Parameters of move_group.
        planning: Parameters of robot_description_planning.

    Raises:
        PlanningError: A parameter of a pipeline cannot be read.
    """

    def __init__(self, node: Mapping[str, Any], planning: Mapping[str, Any] | None = None) -> None:
        pipelines, self.default = pipelines_of(node)
        self.specs = {name: read_pipeline_spec(name, item, planning or {}, node) for name, item in pipelines.items()}

    def names(self) -> tuple[str, ...]:
        """Returns the planner names of the default pipeline, and pipeline/planner for all other pipelines."""
        default_planners = self._planners(self.specs[self.default]) if self.default in self.specs else ()
        others = (f"{name}/{item}" for name, spec in self.specs.items() for item in self._planners(spec))
        return (*default_planners, *(name for name in others if name.partition("/")[0] != self.default))

    def by_pipeline(self) -> dict[str, tuple[str, ...]]:
        """Returns the planner names of each pipeline that loads; empty for a plugin that accepts any name."""
        planners: dict[str, tuple[str, ...]] = {}
        for name, spec in self.specs.items():
            try:
                planners[name] = self._planners(spec) if planner_ids(spec) else ()
            except ModelError:
                continue  # move_group skips a pipeline without plugin
        return planners

    def resolve(self, name: str, group: str = "", pipeline: str = "") -> ResolvedPlanner:
        """Returns the planner that a name refers to.

        Args:
            name: Planner, configuration or PIPELINE/PLANNER; empty for the default planner.
            group: Planning group.
            pipeline: Name of the pipeline; empty for the first pipeline with the planner, starting with the default.

        Raises:
            UnknownNameError: The pipeline or planner does not exist.
            ModelError: The planning_plugin of the pipeline cannot be imported.
        """
        named_pipeline, _, planner = name.rpartition("/")
        requested_pipeline = pipeline or named_pipeline
        if requested_pipeline and requested_pipeline not in self.specs:
            raise UnknownNameError("pipeline", requested_pipeline, tuple(self.specs))
        candidates = (
            [requested_pipeline]
            if requested_pipeline
            else [self.default, *(item for item in self.specs if item != self.default)]
        )
        for item in candidates:
            spec = self.specs.get(item)
            if spec is None:
                raise UnknownNameError("pipeline", item, tuple(self.specs))
            try:
                known = planner_ids(spec)
            except ModelError:
                if requested_pipeline or item == self.default:
                    raise
                continue  # move_group skips a pipeline without plugin
            configuration = without_group(planner or spec.settings.default_planner(group))
            planner_id, settings = resolve_configuration(
                spec.settings.planner_configs.get(configuration) or {}, spec.settings.groups, configuration, group
            )
            if not configuration and known:
                planner_id = known[0]
            if planner_id in known or (requested_pipeline and not known):
                return ResolvedPlanner(item, spec.planner, planner_id, settings, spec.adapters)
        raise UnknownNameError("planner", name, self.names())

    def faults(self, resolved: ResolvedPlanner, settings: Mapping[str, Any] | None = None) -> list[str]:
        """Returns a message per invalid setting of a planner.

        Args:
            resolved: Resolved planner.
            settings: Settings to check; None for the settings of the planner.
        """
        checked = resolved.settings if settings is None else settings
        return planner_class(resolved.plugin).parameter_faults(resolved.planner, checked)

    @staticmethod
    def constrained_planner(resolved: ResolvedPlanner) -> str:
        """Returns the search used if a planner cannot satisfy the path constraints, empty if none."""
        return planner_class(resolved.plugin).constrained_planner

    def adapter_faults(self, pipelines: Iterable[str]) -> dict[str, str]:
        """Returns messages about invalid plugins and request adapters of pipelines, keyed by PIPELINE/PARAMETER."""
        faults: dict[str, str] = {}
        for name in dict.fromkeys(pipelines):
            spec = self.specs.get(name)
            if spec is None:
                continue
            checks: dict[str, Callable[[], object]] = {
                "planning_plugin": partial(planner_class, spec.planner),
                "request_adapters": partial(make_adapters, spec.adapters),
            }
            for parameter, check in checks.items():
                try:
                    check()
                except (ModelError, PlanningError) as error:
                    faults[f"{name}/{parameter}"] = f"pipeline '{name}': {error}"
        return faults

    def _planners(self, spec: PipelineSpec) -> tuple[str, ...]:
        try:
            known = planner_ids(spec)
        except ModelError:
            return ()
        named = (
            name
            for name, item in spec.settings.planner_configs.items()
            if not known or resolve_configuration(item, {}, name, "")[0] in known
        )
        return tuple(dict.fromkeys((*known, *named)))


def planner_ids(spec: PipelineSpec) -> tuple[str, ...]:
    """Returns the planner names of a pipeline's plugin; empty if the plugin accepts any name."""
    return tuple(getattr(planner_class(spec.planner), "planner_ids", ()))
