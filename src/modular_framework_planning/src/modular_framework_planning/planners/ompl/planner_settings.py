# SPDX-License-Identifier: BSD-3-Clause
"""OMPL's geometric planners and their settings, under the names of MoveIt and ompl_planning.yaml."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import ompl.geometric as og

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_ros.allowed_names import listing, nearest

# Maximum length of an edge [rad or m]. OMPL's default, a fifth of the extent of the space, makes most edges too long to
# be free. Tuned for RRTConnect with weighted lengths on MotionBenchMaker's problems: among 0.35, 0.5 and 0.7, 0.5 has
# the lowest mean time for a UR5, a Panda and a Fetch, and takes 5 % longer than 0.35 for a two-armed Baxter.
DEFAULT_RANGE = 0.5


def _bool(value: object) -> bool:
    text = str(value).strip().lower()
    if text not in ("0", "1", "true", "false", "0.0", "1.0"):
        raise ValueError("a flag: 0, 1, true or false")
    return text in ("1", "true", "1.0")


def _number(low: float = -math.inf, high: float = math.inf, whole: bool = False) -> Callable[[object], Any]:
    """Returns a reader of finite numbers in a closed range."""
    allowed = f"a {'whole ' if whole else ''}number"
    allowed += "" if low == -math.inf else f" of at least {low:g}" if high == math.inf else f" from {low:g} to {high:g}"

    def read(value: object) -> float | int:
        try:
            number = float(str(value))
        except ValueError:
            number = math.nan
        if not math.isfinite(number) or not low <= number <= high or (whole and number != int(number)):
            raise ValueError(allowed)
        return int(number) if whole else number

    return read


_NOT_NEGATIVE, _FRACTION, _COUNT = _number(0.0), _number(0.0, 1.0), _number(1, whole=True)
_POSITIVE = _number(1e-9)
Setting = tuple[str, Callable[[object], Any]]
_RANGE: dict[str, Setting] = {"range": ("setRange", _NOT_NEGATIVE)}
_BIAS: dict[str, Setting] = {"goal_bias": ("setGoalBias", _FRACTION)}
_INTERMEDIATE: dict[str, Setting] = {"intermediate_states": ("setIntermediateStates", _bool)}
_CELLS: dict[str, Setting] = {
    "border_fraction": ("setBorderFraction", _FRACTION),
    "min_valid_path_fraction": ("setMinValidPathFraction", _FRACTION),
}
_FAILED: dict[str, Setting] = {"failed_expansion_score_factor": ("setFailedExpansionCellScoreFactor", _FRACTION)}
_STAR: dict[str, Setting] = {
    "delay_collision_checking": ("setDelayCC", _bool),
    "focus_search": ("setFocusSearch", _bool),
    "informed_sampling": ("setInformedSampling", _bool),
    "new_state_rejection": ("setNewStateRejection", _bool),
    "number_sampling_attempts": ("setNumSamplingAttempts", _COUNT),
    "ordered_sampling": ("setOrderedSampling", _bool),
    "ordering_batch_size": ("setBatchSize", _COUNT),
    "prune_threshold": ("setPruneThreshold", _FRACTION),
    "pruned_measure": ("setPrunedMeasure", _bool),
    "rewire_factor": ("setRewireFactor", _POSITIVE),
    "sample_rejection": ("setSampleRejection", _bool),
    "tree_pruning": ("setTreePruning", _bool),
    "use_admissible_heuristic": ("setAdmissibleCostToCome", _bool),
    "use_k_nearest": ("setKNearest", _bool),
}
_MARCHING: dict[str, Setting] = {
    "cache_cc": ("setCacheCC", _bool),
    "extended_fmt": ("setExtendedFMT", _bool),
    "free_space_volume": ("setFreeSpaceVolume", _NOT_NEGATIVE),
    "heuristics": ("setHeuristics", _bool),
    "nearest_k": ("setNearestK", _bool),
    "num_samples": ("setNumSamples", _COUNT),
    "radius_multiplier": ("setRadiusMultiplier", _POSITIVE),
}
_BATCHES: dict[str, Setting] = {
    "delay_rewiring_to_first_solution": ("setDelayRewiringUntilInitialSolution", _bool),
    "drop_unconnected_samples_on_prune": ("setDropSamplesOnPrune", _bool),
    "find_approximate_solutions": ("setConsiderApproximateSolutions", _bool),
    "prune_threshold_as_fractional_cost_change": ("setPruneThresholdFraction", _FRACTION),
    "rewire_factor": ("setRewireFactor", _POSITIVE),
    "samples_per_batch": ("setSamplesPerBatch", _COUNT),
    "stop_on_each_solution_improvement": ("setStopOnSolnImprovement", _bool),
    "use_graph_pruning": ("setPruning", _bool),
    "use_just_in_time_sampling": ("setJustInTimeSampling", _bool),
    "use_k_nearest": ("setUseKNearest", _bool),
    "use_strict_queue_ordering": ("setStrictQueueOrdering", _bool),
}
_ROADMAP: dict[str, Setting] = {"max_nearest_neighbors": ("setMaxNearestNeighbors", _COUNT)}

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
# Planners that look for solutions in their own thread; solve() holds the interpreter lock, so this thread must not call
# Python.
THREADED = frozenset({"PRM", "PRMstar"})
# Planners that improve their path until a termination condition stops them.
ANYTIME = frozenset({"AORRTC", "BITstar", "InformedRRTstar", "PRMstar", "RRTstar", "SORRTstar"})
PATH_LENGTH = "PathLengthOptimizationObjective"
# Keys of ompl_planning.yaml that other modules read, and keys with a single supported value.
GENERAL_KEYS: dict[str, Callable[[object], Any]] = {
    "type": str,
    "projection_evaluator": str,
    "longest_valid_segment_fraction": _number(1e-9, 1.0),
    "maximum_waypoint_distance": _NOT_NEGATIVE,
    "simplify_solutions": _bool,
    "optimization_objective": str,
    "enforce_joint_model_state_space": _bool,
    "enforce_constrained_state_space": _bool,
}
# Settings missing from OMPL's Python interface.
NOT_SETTABLE = {"BFMT": ("balanced", "optimality")}


def parameter_faults(planner_id: str, settings: Mapping[str, object]) -> list[str]:
    """Returns a message per unknown or unreadable setting of a planner; none for an unknown planner."""
    if planner_id not in PLANNERS:
        return []
    known = PLANNERS[planner_id][1]
    faults = []
    for key, value in settings.items():
        if key in NOT_SETTABLE.get(planner_id, ()):
            faults.append(f"'{key}' of {planner_id} cannot be set through OMPL's Python interface; it is ignored")
        elif key in known:
            faults += _unreadable(key, known[key][1], value)
        elif key not in GENERAL_KEYS:
            allowed = sorted((*known, *GENERAL_KEYS))
            faults.append(
                f"{planner_id} has no setting '{key}'; it is ignored; {listing(allowed)}{nearest(key, allowed)}"
            )
        elif faulty := _unreadable(key, GENERAL_KEYS[key], value):
            faults += faulty
        elif key == "optimization_objective" and str(value) != PATH_LENGTH:
            faults.append(f"optimization_objective '{value}' is not available; it is ignored; allowed: {PATH_LENGTH}")
    return faults


def _unreadable(key: str, read: Callable[[object], Any], value: object) -> list[str]:
    if not str(value).strip():
        return []
    try:
        read(value)
    except ValueError as error:
        return [f"'{key}' is '{value}', which cannot be read; it must be {error}"]
    return []


def connection_range(settings: Mapping[str, object]) -> float | None:
    """Returns the range in the settings of RRTConnect [rad or m]; None if it is not set.

    Raises:
        PlanningError: The range cannot be read.
    """
    value = _value("RRTConnect", settings, "range")
    return float(value) if value is not None and value > 0.0 else None


def keeps_intermediate_states(settings: Mapping[str, object]) -> bool:
    """Checks whether the settings of RRTConnect request intermediate states along edges.

    Raises:
        PlanningError: The value cannot be read.
    """
    return bool(_value("RRTConnect", settings, "intermediate_states"))


def _value(planner_id: str, settings: Mapping[str, object], key: str) -> Any:
    """Returns the value of a setting, None if it is empty; raises PlanningError if it cannot be read."""
    text = settings.get(key, "")
    if not str(text).strip():
        return None
    faults = _unreadable(key, PLANNERS[planner_id][1][key][1], text)
    if faults:
        raise PlanningError(ErrorCode.PLANNING_FAILED, f"planner_configs/{planner_id}: {faults[0]}")
    return PLANNERS[planner_id][1][key][1](text)


def make_planner(
    planner_id: str, settings: Mapping[str, object], information: Any, default_range: float = DEFAULT_RANGE
) -> Any:
    """Returns an OMPL planner with its settings applied.

    Args:
        planner_id: Key of PLANNERS.
        settings: Settings, keyed as in ompl_planning.yaml; an empty value or range 0 keeps the default.
        information: OMPL's SpaceInformation.
        default_range: Range if the settings contain none [rad or m].

    Raises:
        PlanningError: A value cannot be read.
    """
    kind, known = PLANNERS[planner_id]
    planner = kind(information)
    if "range" in known:
        planner.setRange(default_range)
    for key in (key for key in settings if key in known):
        value = _value(planner_id, settings, key)
        if value is not None and not (key == "range" and value <= 0.0):
            getattr(planner, known[key][0])(value)
    return planner
