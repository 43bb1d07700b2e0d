# SPDX-License-Identifier: BSD-3-Clause
"""OMPL's geometric planners and their settings, under the names MoveIt and ompl_planning.yaml give them."""
from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import ompl.geometric as og

from modular_framework_planning.errors import ErrorCode, PlanningError

DEFAULT_RANGE = 0.5  # [rad or m]; a fifth of the space, OMPL's own choice, makes edges so long that few are free
# RRTConnect without a range of its own first takes long steps, which cross open space in a few; where that does not
# lead to a path soon, steps of the default range find narrow ways.
LONG_RANGE, LONG_RANGE_ITERATIONS = 1.0, 150


def _flag(value: object) -> bool:
    text = str(value).strip().lower()
    if text not in ("0", "1", "true", "false", "0.0", "1.0"):
        raise ValueError("a flag: 0, 1, true or false")
    return text in ("1", "true", "1.0")


def _real(value: object) -> float:
    return float(str(value))


def _whole(value: object) -> int:
    return int(float(str(value)))


Setting = tuple[str, Callable[[object], Any]]
_RANGE: dict[str, Setting] = {"range": ("setRange", _real)}
_BIAS: dict[str, Setting] = {"goal_bias": ("setGoalBias", _real)}
_INTERMEDIATE: dict[str, Setting] = {"intermediate_states": ("setIntermediateStates", _flag)}
_CELLS: dict[str, Setting] = {"border_fraction": ("setBorderFraction", _real),
                              "min_valid_path_fraction": ("setMinValidPathFraction", _real)}
_FAILED: dict[str, Setting] = {"failed_expansion_score_factor": ("setFailedExpansionCellScoreFactor", _real)}
_STAR: dict[str, Setting] = {
    "delay_collision_checking": ("setDelayCC", _flag), "focus_search": ("setFocusSearch", _flag),
    "informed_sampling": ("setInformedSampling", _flag), "new_state_rejection": ("setNewStateRejection", _flag),
    "number_sampling_attempts": ("setNumSamplingAttempts", _whole), "ordered_sampling": ("setOrderedSampling", _flag),
    "ordering_batch_size": ("setBatchSize", _whole), "prune_threshold": ("setPruneThreshold", _real),
    "pruned_measure": ("setPrunedMeasure", _flag), "rewire_factor": ("setRewireFactor", _real),
    "sample_rejection": ("setSampleRejection", _flag), "tree_pruning": ("setTreePruning", _flag),
    "use_admissible_heuristic": ("setAdmissibleCostToCome", _flag), "use_k_nearest": ("setKNearest", _flag)}
_MARCHING: dict[str, Setting] = {
    "cache_cc": ("setCacheCC", _flag), "extended_fmt": ("setExtendedFMT", _flag),
    "free_space_volume": ("setFreeSpaceVolume", _real), "heuristics": ("setHeuristics", _flag),
    "nearest_k": ("setNearestK", _flag), "num_samples": ("setNumSamples", _whole),
    "radius_multiplier": ("setRadiusMultiplier", _real)}
_BATCHES: dict[str, Setting] = {
    "delay_rewiring_to_first_solution": ("setDelayRewiringUntilInitialSolution", _flag),
    "drop_unconnected_samples_on_prune": ("setDropSamplesOnPrune", _flag),
    "find_approximate_solutions": ("setConsiderApproximateSolutions", _flag),
    "prune_threshold_as_fractional_cost_change": ("setPruneThresholdFraction", _real),
    "rewire_factor": ("setRewireFactor", _real), "samples_per_batch": ("setSamplesPerBatch", _whole),
    "stop_on_each_solution_improvement": ("setStopOnSolnImprovement", _flag),
    "use_graph_pruning": ("setPruning", _flag), "use_just_in_time_sampling": ("setJustInTimeSampling", _flag),
    "use_k_nearest": ("setUseKNearest", _flag), "use_strict_queue_ordering": ("setStrictQueueOrdering", _flag)}
_ROADMAP: dict[str, Setting] = {"max_nearest_neighbors": ("setMaxNearestNeighbors", _whole)}

PLANNERS: dict[str, tuple[type, dict[str, Setting]]] = {
    "RRTConnect": (og.RRTConnect, {**_RANGE, **_INTERMEDIATE}),
    "AORRTC": (og.AORRTC, _RANGE),
    "BFMT": (og.BFMT, _MARCHING),
    "BITstar": (og.BITstar, _BATCHES),
    "BKPIECE": (og.BKPIECE1, {**_RANGE, **_CELLS, **_FAILED}),
    "FMT": (og.FMT, _MARCHING),
    "InformedRRTstar": (og.InformedRRTstar, {**_RANGE, **_BIAS, **_STAR}),
    "KPIECE": (og.KPIECE1, {**_RANGE, **_BIAS, **_CELLS, **_FAILED}),
    "LBKPIECE": (og.LBKPIECE1, {**_RANGE, **_CELLS}),
    "PRM": (og.PRM, _ROADMAP),
    "PRMstar": (og.PRMstar, {}),
    "RRT": (og.RRT, {**_RANGE, **_BIAS, **_INTERMEDIATE}),
    "RRTstar": (og.RRTstar, {**_RANGE, **_BIAS, **_STAR}),
    "SORRTstar": (og.SORRTstar, {**_RANGE, **_BIAS, **_STAR}),
}
# Planners that look for solutions in a thread of their own: it must not need the interpreter, whose lock solve() holds.
THREADED = frozenset({"PRM", "PRMstar"})
# Planners that go on to improve what they found until they are told to stop.
ANYTIME = frozenset({"AORRTC", "BITstar", "InformedRRTstar", "PRMstar", "RRTstar", "SORRTstar"})
PATH_LENGTH = "PathLengthOptimizationObjective"
# Keys of ompl_planning.yaml that are read elsewhere, and those whose other values this OMPL has nothing for.
GENERAL_KEYS = ("type", "projection_evaluator", "longest_valid_segment_fraction", "maximum_waypoint_distance",
                "simplify_solutions", "optimization_objective", "enforce_joint_model_state_space",
                "enforce_constrained_state_space")
# Settings OMPL has, but not in its Python interface.
NOT_SETTABLE = {"BFMT": ("balanced", "optimality")}


def parameter_faults(planner_id: str, settings: Mapping[str, object]) -> list[str]:
    """Says which settings of a planner are unknown or unreadable, one sentence each; nothing for a planner not here."""
    if planner_id not in PLANNERS:
        return []
    known = PLANNERS[planner_id][1]
    faults = []
    for key, value in settings.items():
        if key in NOT_SETTABLE.get(planner_id, ()):
            faults.append(f"'{key}' of {planner_id} cannot be set through OMPL's Python interface and is left as it is")
        elif key in known:
            faults += _unreadable(key, known[key][1], value)
        elif key not in GENERAL_KEYS:
            faults.append(f"{planner_id} has no setting '{key}'; it is ignored; allowed are "
                          f"{', '.join(sorted((*known, *GENERAL_KEYS)))}")
        elif key == "optimization_objective" and str(value) != PATH_LENGTH:
            faults.append(f"optimization_objective '{value}' is not available and ignored; allowed is {PATH_LENGTH}")
    return faults


def _unreadable(key: str, read: Callable[[object], Any], value: object) -> list[str]:
    if not str(value).strip():
        return []
    try:
        read(value)
    except ValueError as error:
        return [f"'{key}' is '{value}', which cannot be read: {error}"]
    return []


def stages(planner_id: str, settings: Mapping[str, object]) -> tuple[tuple[float, int | None], ...]:
    """Returns (default range [rad or m], most iterations or None) of each search to make, one after the other."""
    if planner_id != "RRTConnect" or str(settings.get("range", "")).strip() not in ("", "0", "0.0"):
        return ((DEFAULT_RANGE, None),)
    return (LONG_RANGE, LONG_RANGE_ITERATIONS), (DEFAULT_RANGE, None)


def make_planner(planner_id: str, settings: Mapping[str, object], information: Any,
                 default_range: float = DEFAULT_RANGE) -> Any:
    """Makes an OMPL planner with its settings.

    Args:
        planner_id: key of PLANNERS.
        settings: by ompl_planning.yaml's keys; an empty value, and range 0, keep the default.
        default_range: range where the settings give none [rad or m].
        information: OMPL's SpaceInformation.

    Raises:
        PlanningError: a value cannot be read.
    """
    kind, known = PLANNERS[planner_id]
    planner = kind(information)
    if "range" in known:
        planner.setRange(default_range)
    for key, value in settings.items():
        if key not in known or not str(value).strip():
            continue
        faults = _unreadable(key, known[key][1], value)
        if faults:
            raise PlanningError(ErrorCode.PLANNING_FAILED, f"planner_configs/{planner_id}: {faults[0]}")
        number = known[key][1](value)
        if not (key == "range" and number <= 0.0):
            getattr(planner, known[key][0])(number)
    return planner
