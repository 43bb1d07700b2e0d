# SPDX-License-Identifier: BSD-3-Clause
"""Declares the figures that components of the framework report, for reporters and metrics.

User-defined components may report further figures, for which `declared_figure` returns a declaration without unit
and clock.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum


class Clock(Enum):
    """Clock that measures a duration."""

    SIMULATED = "simulated time"
    WALL = "real time"
    PROCESSOR = "processor time"


class Source(Enum):
    """Origin of a figure."""

    MEASURED = "measured"  # by the framework, outside the method
    SAID = "said by the method"  # not verified


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure that a component reports for each task.

    Attributes:
        name: Key in reports and recordings, with the unit as suffix: `planning_time_s`.
        component: Component that reports the figure.
        unit: Unit of the values; "" for none.
        description: Meaning, in a sentence.
        clock: Clock of a duration; None for other figures.
        source: Origin of the figure in an episode of the whole stack.
    """

    name: str
    component: str
    unit: str = ""
    description: str = ""
    clock: Clock | None = None
    source: Source = Source.SAID


CANDIDATES = Figure("candidates", "generation", "", "Grasps found before their reachability was checked.")
CHECKED = Figure("checked", "generation", "", "Grasps whose reachability was checked.")
REACHABLE = Figure("reachable", "generation", "", "Grasps that the arm can reach without a collision.")
BEST_RANK = Figure("best_rank", "generation", "", "Rank of the first reachable grasp in the method's order, from 1.")
METHOD_TIME = Figure("method_time_s", "generation", "s", "Time of an external method in its process.", Clock.WALL)
QUEUE_TIME = Figure("queue_time_s", "generation", "s", "Wait of requests to an external method.", Clock.WALL)
TRANSPORT_TIME = Figure(
    "transport_time_s", "generation", "s", "Time to exchange messages with an external method.", Clock.WALL
)
METHOD_FAULT = Figure(
    "method_fault",
    "generation",
    "",
    "Fault of an external method, a value of `mbf_method.errors.MethodFault`.",
    source=Source.MEASURED,
)
PLANNER_METHOD_TIME, PLANNER_QUEUE_TIME, PLANNER_TRANSPORT_TIME, PLANNER_FAULT = (
    replace(figure, component="planning") for figure in (METHOD_TIME, QUEUE_TIME, TRANSPORT_TIME, METHOD_FAULT)
)
"""The same figures of a planner."""
POLICY_METHOD_TIME, POLICY_QUEUE_TIME, POLICY_TRANSPORT_TIME, POLICY_FAULT = (
    replace(figure, component="policy") for figure in (METHOD_TIME, QUEUE_TIME, TRANSPORT_TIME, METHOD_FAULT)
)
"""The same figures of a policy, summed over its queries."""
POLICY_QUERIES = Figure("queries", "policy", "", "Queries that the policy answered.", source=Source.MEASURED)
POLICY_CHUNKS = Figure("chunks", "policy", "", "Chunks of actions that the arm executed.", source=Source.MEASURED)
POLICY_ACTIONS = Figure("actions", "policy", "", "Actions that the arm executed.", source=Source.MEASURED)
POLICY_LATE = Figure(
    "late_answers", "policy", "", "Answers that took longer than the period of an action.", source=Source.MEASURED
)
POLICY_CLIPPED = Figure(
    "clipped_actions", "policy", "", "Executed actions whose targets were moved to the limits.", source=Source.MEASURED
)
SOURCES_PARAMETER = "method_sources"
"""Private parameter with the digest of the sources of an external method, set by its node."""
PLANNING_TIME = Figure("planning_time_s", "planning", "s", "Time from request to answer.", Clock.WALL, Source.MEASURED)
PROCESSOR_TIME = Figure("processor_s", "planning", "s", "Processor time of the plan.", Clock.PROCESSOR, Source.MEASURED)
CONCURRENT = Figure(
    "concurrent", "planning", "", "Number of concurrent plans, including this plan.", source=Source.MEASURED
)
SEARCH_TIME = Figure(
    "search_time_s", "planning", "s", "Time until the planner found a path.", Clock.WALL, Source.MEASURED
)
CLEARANCE = Figure("clearance_m", "planning", "m", "Smallest distance along the motion.", source=Source.MEASURED)
ATTEMPTS = Figure("attempts", "planning", "", "Searches that the planner started.", source=Source.MEASURED)
ERROR_CODE = Figure(
    "error_code",
    "planning",
    "",
    "Result as a code of moveit_msgs/MoveItErrorCodes; 1 is success.",
    source=Source.MEASURED,
)
SOLVED_SHARE = Figure("solved_share", "kinematics", "", "Fraction of the poses solved.", source=Source.MEASURED)
SOLVING_TIME = Figure("solving_time_s", "kinematics", "s", "Median time per pose.", Clock.WALL, Source.MEASURED)
SOLUTIONS = Figure("solutions", "kinematics", "", "Mean number of solutions per pose.", source=Source.MEASURED)
POSITION_ERROR = Figure(
    "position_error_m", "kinematics", "m", "Greatest distance of the tip from a solved pose.", source=Source.MEASURED
)
ROTATION_ERROR = Figure(
    "rotation_error_rad", "kinematics", "rad", "Greatest angle of the tip from a solved pose.", source=Source.MEASURED
)

FIGURES = {(found.component, found.name): found for found in list(globals().values()) if isinstance(found, Figure)}
"""All declared figures by component and name."""


def declared_figure(component: str, name: str) -> Figure:
    """Returns the declaration of a figure; for a user-defined figure a declaration without unit and clock."""
    return FIGURES.get((component, name)) or Figure(name, component)
