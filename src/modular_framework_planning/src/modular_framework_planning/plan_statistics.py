# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of a plan: duration of each phase, results of the layers of the collision check, and the main obstacle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from modular_framework_ros.reported_figures import Figure

NARROW_FRACTION = 0.5  # minimum fraction of checks in collision that indicates a narrow passage


@dataclass(frozen=True, slots=True)
class CheckCounts:
    """Numbers of collision checks of states, edges and curves, by the layer that decided them.

    Attributes:
        asked: Number of requested checks, excluding cached results.
        free_by_bounds: Checks that the compiled check of spheres and surfaces found free.
        touching_by_bounds: Checks that the compiled check found in collision.
        undecided: Checks left to the exact check (Coal).
        touching_exactly: Checks that the exact check found in collision.
        states: States processed by the compiled check; states of undecided edges of a compiled search count twice.
    """

    asked: int
    free_by_bounds: int
    touching_by_bounds: int
    undecided: int
    touching_exactly: int
    states: int

    @property
    def colliding_checks(self) -> int:
        """Number of checks that found a collision."""
        return self.touching_by_bounds + self.touching_exactly


@dataclass(frozen=True, slots=True)
class Refusals:
    """Pair of bodies with the most collisions.

    The first link of a joint represents all links on this joint. A check with several colliding pairs counts for the
    pair that is found first.

    Attributes:
        first: Name of the first body.
        second: Name of the second body.
        checks: Number of checks in which the bodies collide.
    """

    first: str
    second: str
    checks: int


@dataclass(frozen=True, slots=True)
class PlannerRun:
    """Resolved pipeline, planner and settings of a plan.

    Attributes:
        pipeline: Planning pipeline.
        planner: Planner of the pipeline.
        settings: Parameters of the planner, including parameters of the group.
        adapters: Request adapters, outermost first.
        implementation: Implementation of the search (`compiled`, `OMPL` or `CBiRRT`); empty without a search.
        replaced: Requested planner_id that the pipeline does not have; otherwise empty.
        solver: Inverse kinematics solver of pose goals; empty without a pose goal.
        collision_checker: Class of the collision checker as `module/Class`.
        sources: SHA-256 of the sources that the planner's own process has imported; empty if the process does not
            report them, None for a planner without a process.
    """

    pipeline: str
    planner: str
    settings: Mapping[str, Any]
    adapters: tuple[str, ...] = ()
    implementation: str = ""
    replaced: str = ""
    solver: str = ""
    collision_checker: str = ""
    sources: str | None = None


@dataclass(frozen=True, slots=True)
class PlanStatistics:
    """Statistics of a successful or failed plan.

    Attributes:
        phases_s: Durations of the phases, by name [s].
        checks: Collision checks by phase; empty if the collision checker has no counters.
        refusals: Pair of bodies with the most collisions; None without a collision.
        run: Resolved pipeline and planner; None if the request was rejected before planning.
        processor_s: Processor time of the plan [s]; independent of concurrent plans.
        figures: Figures that the planner reports.
    """

    phases_s: Mapping[str, float] = field(default_factory=dict)
    checks: Mapping[str, CheckCounts] = field(default_factory=dict)
    refusals: Refusals | None = None
    run: PlannerRun | None = None
    processor_s: float = 0.0
    figures: Mapping[Figure, float] = field(default_factory=dict)

    @property
    def summary(self) -> str:
        """Sentence with the longest phase and its cause; empty without measurements."""
        if not self.phases_s:
            return ""
        phase = max(self.phases_s, key=lambda name: self.phases_s[name])
        text = f"{phase} took {1e3 * self.phases_s[phase]:.0f} of {1e3 * sum(self.phases_s.values()):.0f} ms"
        counts = self.checks.get(phase)
        if counts is None or not counts.asked:
            return text
        text += f": {counts.asked:,} collision checks, {counts.undecided / counts.asked:.1%} undecided by the bounds"
        if self.refusals is None or not counts.colliding_checks:
            return text
        bodies = f"'{self.refusals.first}' and '{self.refusals.second}'"
        fraction = counts.colliding_checks / counts.asked
        return f"{text}, {fraction:.0%} in collision: " + (
            f"narrow passage between {bodies}" if fraction >= NARROW_FRACTION else f"most often {bodies}"
        )

    def as_json(self) -> dict[str, Any]:
        """Returns the fields for ~planning_report as JSON types."""
        return {
            "phases_s": dict(self.phases_s),
            "processor_s": self.processor_s,
            "checks": {part: asdict(counts) for part, counts in self.checks.items()},
            "refusals": None if self.refusals is None else asdict(self.refusals),
            "summary": self.summary,
            "run": None if self.run is None else asdict(self.run),
            **{figure.name: value for figure, value in self.figures.items()},
        }
