# SPDX-License-Identifier: BSD-3-Clause
"""What an episode ran with, as the running nodes said; not what its experiment file names."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from modular_framework_planning.kinematics.kinematics_settings import CLOSED_FORM, NUMERIC
from modular_framework_planning.plan_statistics import PlannerRun


@dataclass(frozen=True, slots=True)
class RanPlanner:
    """A planner that planned.

    Attributes:
        settings: Its parameters as resolved.
        request_adapters: Request adapters, outermost first.
        implementations: Who searched for it: `compiled`, `OMPL`, `CBiRRT`; none where straight motions were enough.
    """

    settings: Mapping[str, Any]
    request_adapters: tuple[str, ...]
    implementations: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Returns its settings and, beside them, how it planned."""
        return {
            **self.settings,
            "request_adapters": ", ".join(self.request_adapters),
            IMPLEMENTATION: ", ".join(self.implementations),
        }


@dataclass(frozen=True, slots=True)
class RanMethod:
    """A method that generated grasps: the version of its package, and SHA-256 of its sources."""

    version: str
    sources: str


@dataclass(frozen=True, slots=True)
class WhatRan:
    """The parts of an episode; those that a mode does not have are empty.

    Attributes:
        planners: Each planner, by its name and that of its pipeline.
        solver: Methods of inverse kinematics; empty if no pose was solved for.
        methods: Each method that generates grasps, by package.
        controllers: Type of each controller that ran, by name.
        physics_engine: What moved the bodies.
        renderer: What drew the images of cameras; empty without a camera.
        digests: SHA-256 of the robot description, the world and the task, by what they are.
        substitutions: What ran in place of what was named, as documented: constrained plans of CBiRRT.
        replaced: What was named and is not there, with what ran instead: such an episode is invalid.
    """

    planners: Mapping[str, RanPlanner] = field(default_factory=dict)
    solver: str = ""
    methods: Mapping[str, RanMethod] = field(default_factory=dict)
    controllers: Mapping[str, str] = field(default_factory=dict)
    physics_engine: str = ""
    renderer: str = ""
    digests: Mapping[str, str] = field(default_factory=dict)
    substitutions: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Returns the part of a snapshot that says what ran."""
        return asdict(self) | {"planners": {name: planner.as_json() for name, planner in self.planners.items()}}

    @classmethod
    def from_parts(cls, parts: Mapping[str, Any]) -> WhatRan:
        """Returns what another process has written by `dataclasses.asdict`, as JSON values."""
        return cls(
            **{
                **parts,
                "planners": {name: RanPlanner(**planner) for name, planner in parts.get("planners", {}).items()},
                "methods": {name: RanMethod(**method) for name, method in parts.get("methods", {}).items()},
                "substitutions": tuple(parts.get("substitutions", ())),
                "replaced": tuple(parts.get("replaced", ())),
            }
        )

    def with_plans(self, runs: Iterable[PlannerRun]) -> WhatRan:
        """Returns it with what planned.

        Args:
            runs: What planned each motion, also each one that failed.
        """
        runs, planners = list(runs), dict[str, RanPlanner]()
        substitutions, replaced = set(self.substitutions), set(self.replaced)
        solvers = {self.solver, *(run.solver for run in runs)} - {""}
        for run in runs:
            name = f"{run.planner} of {run.pipeline}"
            before = planners[name].implementations if name in planners else ()
            searched = tuple(sorted({*before, run.implementation} - {""}))
            planners[name] = RanPlanner(run.settings, tuple(run.adapters), searched)
            if run.implementation == CONSTRAINED != run.planner:
                substitutions.add(substitution_text(run.planner))
            if run.replaced:
                replaced.add(f"planner '{run.replaced}' was named, and {run.planner} planned")
        return replace(
            self,
            planners=planners,
            solver=", ".join(sorted(solvers)),
            substitutions=tuple(sorted(substitutions)),
            replaced=tuple(sorted(replaced)),
        )


IMPLEMENTATION = "implementation"
"""Key of a planner's implementations in a snapshot."""
CONSTRAINED = "CBiRRT"
"""The search of plans whose path constraints no other planner can keep."""


def substitution_text(planner: str, constrained: str = CONSTRAINED) -> str:
    """Returns what a record and a dry run say of a planner that another search replaces."""
    return f"{constrained} for {planner}, which cannot keep path constraints"


def solver_substitutions(named: Iterable[str]) -> tuple[str, ...]:
    """Returns the substitutions of the solvers that kinematics.yaml names, as records and dry runs show them."""
    plugins = sorted(set(named) - {"", NUMERIC, CLOSED_FORM})
    return tuple(f"the framework's inverse kinematics for {plugin}" for plugin in plugins)


def description_digests(urdf: str, srdf: str) -> dict[str, str]:
    """Returns SHA-256 of the texts that describe a robot, hexadecimal, by what they are; without empty ones."""
    texts = {"robot description": urdf, "semantic description": srdf}
    return {what: hashlib.sha256(text.encode()).hexdigest() for what, text in texts.items() if text}
