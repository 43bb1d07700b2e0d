# SPDX-License-Identifier: BSD-3-Clause
"""Resolves the names of planners, pipelines and request adapters from parameters alone, before any node starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.planning_interface.planner_configurations import planner_kind, without_group
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec, pipelines_of, read_pipeline_spec
from modular_framework_planning.planning_pipeline.plugins import make_adapters, planner_class


class UnknownNameError(Exception):
    """Nothing answers to a name.

    Attributes:
        what: Kind of thing that was named.
        name: The name.
        known: Names there are.
    """

    def __init__(self, what: str, name: str, known: tuple[str, ...]) -> None:
        super().__init__(f"there is no {what} '{name}'; allowed: {', '.join(known)}")
        self.what, self.name, self.known = what, name, known


@dataclass(frozen=True, slots=True)
class ResolvedPlanner:
    """What plans the requests that ask for a planner by a name.

    Attributes:
        pipeline: Name of the pipeline.
        plugin: Its parameter planning_plugin.
        planner: Name that the plugin knows the planner by.
        settings: Settings of that planner, by the names of ompl_planning.yaml.
        adapters: Parameter request_adapters: adapters around the planner, outermost first.
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
        planning: robot_description_planning.

    Raises:
        PlanningError: A parameter of a pipeline cannot be read.
    """

    def __init__(self, node: Mapping[str, Any], planning: Mapping[str, Any] | None = None) -> None:
        pipelines, self.default = pipelines_of(node)
        self.specs = {name: read_pipeline_spec(name, item, planning or {}, node) for name, item in pipelines.items()}

    def names(self) -> tuple[str, ...]:
        """Returns the planners by name: those of all pipelines, and as pipeline/planner those of the others."""
        own = self._planners(self.specs[self.default]) if self.default in self.specs else ()
        others = (f"{name}/{item}" for name, spec in self.specs.items() for item in self._planners(spec))
        return (*own, *(name for name in others if name.partition("/")[0] != self.default))

    def all_names(self) -> tuple[str, ...]:
        """Returns every name that a planner answers to: alone, and as PIPELINE/PLANNER."""
        planners = [(name, item) for name, spec in self.specs.items() for item in self._planners(spec)]
        return tuple(dict.fromkeys(text for name, item in planners for text in (item, f"{name}/{item}")))

    def resolve(self, name: str, group: str = "", pipeline: str = "") -> ResolvedPlanner:
        """Returns what plans.

        Args:
            name: Planner or configuration, or PIPELINE/PLANNER; empty for the default.
            group: Planning group.
            pipeline: Name of the pipeline; empty for the default, or the only one that has the planner.

        Raises:
            UnknownNameError: There is no such pipeline or planner.
            ModelError: The pipeline's planning_plugin cannot be imported.
        """
        given, _, planner = name.rpartition("/")
        wanted = pipeline or given
        if wanted and wanted not in self.specs:
            raise UnknownNameError("pipeline", wanted, tuple(self.specs))
        order = [wanted] if wanted else [self.default, *(item for item in self.specs if item != self.default)]
        for item in order:
            spec = self.specs.get(item)
            if spec is None:
                raise UnknownNameError("pipeline", item, tuple(self.specs))
            try:
                known = planner_ids(spec)
            except ModelError:
                if wanted or item == self.default:
                    raise
                continue  # move_group leaves such a pipeline out
            asked = without_group(planner or spec.settings.default_planner(group))
            kind, settings = planner_kind(
                spec.settings.planner_configs.get(asked) or {}, spec.settings.groups, asked, group
            )
            if not asked and known:
                kind = known[0]
            if kind in known or (wanted and not known):
                return ResolvedPlanner(item, spec.planner, kind, settings, spec.adapters)
        raise UnknownNameError("planner", name, self.names())

    def faults(self, found: ResolvedPlanner, settings: Mapping[str, Any] | None = None) -> list[str]:
        """Returns what is wrong with the settings of a planner, one sentence each.

        Args:
            found: The planner.
            settings: Settings to check; None for its own.
        """
        check = getattr(planner_class(found.plugin), "parameter_faults", None)
        return list(check(found.planner, found.settings if settings is None else settings)) if check else []

    @staticmethod
    def constrained_planner(found: ResolvedPlanner) -> str:
        """Returns what searches in place of a planner that cannot keep path constraints; empty if nothing does."""
        return str(getattr(planner_class(found.plugin), "constrained_planner", ""))

    def adapter_faults(self, pipelines: Iterable[str]) -> dict[str, str]:
        """Returns what is wrong with the plugins and request adapters of some pipelines.

        Returns:
            A sentence by PIPELINE/PARAMETER.
        """
        faults: dict[str, str] = {}
        for name in dict.fromkeys(pipelines):
            spec = self.specs.get(name)
            if spec is None:
                continue
            checks = {
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
            if not known or planner_kind(item, {}, name, "")[0] in known
        )
        return tuple(dict.fromkeys((*known, *named)))


def planner_ids(spec: PipelineSpec) -> tuple[str, ...]:
    """Returns the planners that a pipeline's plugin has; empty if it takes any name."""
    return tuple(getattr(planner_class(spec.planner), "planner_ids", ()))
