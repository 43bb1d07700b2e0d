# SPDX-License-Identifier: BSD-3-Clause
"""What a plan took: the time of its parts, what each layer of the collision check decided, and what slowed it down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

NARROW_SHARE = 0.5  # of checks that are refused: from here on the way counts as narrow


@dataclass(frozen=True, slots=True)
class CheckCounts:
    """How many checks of states, edges and curves each layer decided.

    Attributes:
        asked: checks that were asked for; one that was remembered does not count.
        free_by_bounds, touching_by_bounds: decided by the compiled check of spheres and surfaces.
        undecided: left to the exact check (Coal).
        touching_exactly: of these, those in which bodies touch.
        states: that the compiled check looked at, those of undecided edges of a compiled search twice.
    """

    asked: int
    free_by_bounds: int
    touching_by_bounds: int
    undecided: int
    touching_exactly: int
    states: int

    @property
    def refused(self) -> int:
        """How many checks found bodies that touch."""
        return self.touching_by_bounds + self.touching_exactly


@dataclass(frozen=True, slots=True)
class Refusals:
    """Two bodies by name, and in how many checks they touched; of links on one joint the first is named.

    Where several pairs touch, the first pair found counts.
    """

    first: str
    second: str
    checks: int


@dataclass(frozen=True, slots=True)
class PlannerRun:
    """What planned, as it was resolved.

    Attributes:
        pipeline: the planning pipeline.
        planner: its planner.
        settings: parameters of the planner, those of the group among them.
        adapters: request adapters, outermost first.
        implementation: who searched: `compiled`, `OMPL`, `CBiRRT`; empty where no search was needed or it never began.
        replaced: the planner_id that was asked for and that the pipeline does not have; empty otherwise.
        solver: Method of the inverse kinematics of pose goals; empty if there is no pose goal.
    """

    pipeline: str
    planner: str
    settings: Mapping[str, Any]
    adapters: tuple[str, ...] = ()
    implementation: str = ""
    replaced: str = ""
    solver: str = ""


@dataclass(frozen=True, slots=True)
class PlanStatistics:
    """Statistics of one plan, also of one that failed.

    Attributes:
        phases_s: how long its parts took [s].
        checks: of the collision checker by part of the plan; empty for a checker that does not count.
        refusals: the two bodies that refused the most checks; None where none did.
        run: what planned; None where the request was refused before.
        processor_s: processor time of the plan [s], which plans at the same time do not lengthen by waiting.
    """

    phases_s: Mapping[str, float] = field(default_factory=dict)
    checks: Mapping[str, CheckCounts] = field(default_factory=dict)
    refusals: Refusals | None = None
    run: PlannerRun | None = None
    processor_s: float = 0.0

    @property
    def summary(self) -> str:
        """One sentence: which part took the longest, and why; empty where nothing was measured."""
        if not self.phases_s:
            return ""
        part = max(self.phases_s, key=lambda name: self.phases_s[name])
        text = f"{part} took {1e3 * self.phases_s[part]:.0f} of {1e3 * sum(self.phases_s.values()):.0f} ms"
        counts = self.checks.get(part)
        if counts is None or not counts.asked:
            return text
        text += f": {counts.asked:,} collision checks, {counts.undecided / counts.asked:.1%} undecided by the bounds"
        if self.refusals is None or not counts.refused:
            return text
        bodies = f"'{self.refusals.first}' and '{self.refusals.second}'"
        share = counts.refused / counts.asked
        return f"{text}, {share:.0%} refused: " + (
            f"narrow passage between {bodies}" if share >= NARROW_SHARE else f"most often {bodies} touched"
        )

    def as_json(self) -> dict[str, Any]:
        """Returns what ~planning_report says, for json.dumps."""
        return {
            "phases_s": dict(self.phases_s),
            "processor_s": self.processor_s,
            "checks": {part: asdict(counts) for part, counts in self.checks.items()},
            "refusals": None if self.refusals is None else asdict(self.refusals),
            "summary": self.summary,
            "run": None if self.run is None else asdict(self.run),
        }
