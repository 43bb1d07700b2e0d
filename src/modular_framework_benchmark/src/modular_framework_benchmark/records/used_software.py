# SPDX-License-Identifier: BSD-3-Clause
"""Software that an episode used, as reported by the running nodes instead of the experiment file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from modular_framework_planning.kinematics.kinematics_settings import CLOSED_FORM, NUMERIC
from modular_framework_planning.plan_statistics import PlannerRun


@dataclass(frozen=True, slots=True)
class UsedPlanner:
    """A planner that ran.

    Attributes:
        settings: Resolved parameters.
        request_adapters: Request adapters, outermost first.
        implementations: Implementations that searched: `compiled`, `OMPL`, `CBiRRT`; empty for straight motions.
        sources: SHA-256 of the sources in the planner's own process; empty if unknown, None without a process.
    """

    settings: Mapping[str, Any]
    request_adapters: tuple[str, ...]
    implementations: tuple[str, ...]
    sources: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Returns the settings, extended by request adapters, implementations and known sources."""
        return {
            **self.settings,
            "request_adapters": ", ".join(self.request_adapters),
            IMPLEMENTATION: ", ".join(self.implementations),
            **({"sources": self.sources} if self.sources else {}),
        }


@dataclass(frozen=True, slots=True)
class UsedMethod:
    """A method.

    Attributes:
        version: Version of its package; "" if unknown.
        sources: SHA-256 of its sources; "" if unknown.
        said_name: Name that its process states; "" for none.
        said_version: Version that its process states; "" for none.
    """

    version: str
    sources: str
    said_name: str = ""
    said_version: str = ""

    def as_json(self) -> dict[str, str]:
        """Returns version and sources, extended by the statements of the process."""
        said = {"said_name": self.said_name, "said_version": self.said_version}
        return {"version": self.version, "sources": self.sources, **{key: text for key, text in said.items() if text}}


@dataclass(frozen=True, slots=True)
class UsedSoftware:
    """Software that an episode used; parts that a mode lacks are empty.

    Attributes:
        planners: Planners, keyed by "PLANNER of PIPELINE".
        solver: Inverse kinematics methods; empty if no pose was solved.
        collision_checker: Classes of the collision checkers as `module/Class`; empty without a plan.
        methods: Grasp generation methods, keyed by package; methods with their own process, such as policies, by
            command or address.
        unknown_sources: Methods and planners whose process does not report its sources.
        controllers: Types of the running controllers, keyed by name.
        physics_engine: Physics engine of the simulation.
        renderer: Renderer of the cameras; empty without cameras.
        digests: SHA-256 of the robot's descriptions and meshes, of the world and the objects with the files that they
            name, of the task, and of the controllers' parameters, keyed by description.
        substitutions: Documented substitutions of named software, such as CBiRRT for constrained plans.
        replaced: Named software that was missing, with its replacement, which makes the episode invalid.
    """

    planners: Mapping[str, UsedPlanner] = field(default_factory=dict)
    solver: str = ""
    collision_checker: str = ""
    methods: Mapping[str, UsedMethod] = field(default_factory=dict)
    unknown_sources: tuple[str, ...] = ()
    controllers: Mapping[str, str] = field(default_factory=dict)
    physics_engine: str = ""
    renderer: str = ""
    digests: Mapping[str, str] = field(default_factory=dict)
    substitutions: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()

    @property
    def invalid_cause(self) -> str:
        """Returns why an episode that used this software is invalid; "" if the named software ran."""
        return f"the named software did not run: {'; '.join(self.replaced)}" if self.replaced else ""

    def as_json(self) -> dict[str, Any]:
        """Returns the entries of a snapshot."""
        return asdict(self) | {
            "planners": {name: planner.as_json() for name, planner in self.planners.items()},
            "methods": {name: method.as_json() for name, method in self.methods.items()},
        }

    def with_external_method(self, name: str, method: UsedMethod) -> UsedSoftware:
        """Returns this object with a method that runs in its own process.

        Args:
            name: Command or address of the method.
            method: Method with the sources that its process reports.
        """
        unknown = {*self.unknown_sources, *([] if method.sources else [name])}
        return replace(self, methods={**self.methods, name: method}, unknown_sources=tuple(sorted(unknown)))

    def with_plans(self, runs: Iterable[PlannerRun]) -> UsedSoftware:
        """Returns this object with the planners of the given runs.

        Args:
            runs: Planner run of each motion, including failed runs.
        """
        runs, planners = list(runs), dict[str, UsedPlanner]()
        substitutions, replaced = set(self.substitutions), set(self.replaced)
        solvers = {self.solver, *(run.solver for run in runs)} - {""}
        checkers = {self.collision_checker, *(run.collision_checker for run in runs)} - {""}
        for run in runs:
            name = f"{run.planner} of {run.pipeline}"
            before = planners[name].implementations if name in planners else ()
            searched = tuple(sorted({*before, run.implementation} - {""}))
            planners[name] = UsedPlanner(run.settings, tuple(run.adapters), searched, run.sources)
            if run.implementation == CONSTRAINED != run.planner:
                substitutions.add(substitution_text(run.planner))
            if run.replaced:
                replaced.add(f"planner '{run.replaced}' was named, and {run.planner} planned")
        unknown = {name for name, planner in planners.items() if planner.sources == ""}
        return replace(
            self,
            planners=planners,
            unknown_sources=tuple(sorted({*self.unknown_sources, *unknown})),
            solver=", ".join(sorted(solvers)),
            collision_checker=", ".join(sorted(checkers)),
            substitutions=tuple(sorted(substitutions)),
            replaced=tuple(sorted(replaced)),
        )


IMPLEMENTATION = "implementation"
"""Snapshot key of a planner's implementations."""
DEFAULT_DETECTOR = "fcl"
"""Name of the framework's checker in the parameter `collision_detector`; MoveIt's other names also select it."""
CONSTRAINED = "CBiRRT"
"""Planner of requests whose path constraints other planners cannot satisfy."""


def substitution_text(planner: str, constrained: str = CONSTRAINED) -> str:
    """Returns the text of a substitution in records and in the dry run."""
    return f"{constrained} for {planner}, which cannot keep path constraints"


def named_solvers(kinematics: object) -> list[str]:
    """Returns the solver of each group in the contents of kinematics.yaml."""
    groups = kinematics.values() if isinstance(kinematics, Mapping) else ()
    return [str(group.get("kinematics_solver", "")) for group in groups if isinstance(group, Mapping)]


def solver_substitutions(named: Iterable[str]) -> tuple[str, ...]:
    """Returns the substitutions of the solvers that kinematics.yaml names, as records and dry runs show them."""
    plugins = sorted(set(named) - {"", NUMERIC, CLOSED_FORM})
    return tuple(f"the framework's inverse kinematics for {plugin}" for plugin in plugins)


def detector_substitutions(named: str) -> tuple[str, ...]:
    """Returns the substitution of a named collision detector, as records and dry runs show it.

    Args:
        named: MoveIt's name, or `module/Class`, which runs itself; "" for the default.
    """
    if "/" in named or named.lower() in ("", DEFAULT_DETECTOR):
        return ()
    return (f"the framework's exact collision checker for {named}",)
