# SPDX-License-Identifier: BSD-3-Clause
"""Declaration of the parts of an episode's snapshot: the episodes in which each part must be equal."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from modular_framework_benchmark.records.results import COLD_START, FAILURE_CLASS, WORKER_COUNT


class PartKind(Enum):
    """Kind of a snapshot part, which decides how reports and comparisons use its values."""

    SOFTWARE = "software"  # decisive: equal in all episodes of an experiment
    CONTENT = "content"  # decisive: equal in all episodes with the same levels, if recorded
    NOTE = "note"  # descriptive: listed, and compared between experiments
    SETTING = "setting"  # compared between experiments, not listed
    MEASURED = "measured"  # only summarised
    VARYING = "varying"  # expected to differ between episodes; neither listed nor compared


SETTINGS, REFERENCE, UNKNOWN_SOURCES = "settings", "reference_s", "unknown_sources"
_PARTS: Mapping[PartKind, tuple[str, ...]] = {
    PartKind.SOFTWARE: (
        *("version", "git_revision", "git_changed", "python", "ros_distribution"),
        *("packages", "ros_packages", "environment", "methods", "machine"),
    ),
    PartKind.CONTENT: ("planners", "collision_checker", "controllers", "physics_engine", "renderer", "digests"),
    PartKind.NOTE: (
        WORKER_COUNT,
        "solver",
        "substitutions",
        UNKNOWN_SOURCES,
        "replaced",
        "shake_fault",
        "video_fault",
        "recording_fault",
    ),
    PartKind.SETTING: (SETTINGS,),
    PartKind.MEASURED: (
        *("metric_faults", "earlier_tries", REFERENCE),
        *("load_before", "load_after", "stolen_s", "busy_s", "others_share", "workers_share"),
    ),
    PartKind.VARYING: ("seed", "parameters", "final_objects", "world_digest", COLD_START, FAILURE_CLASS),
}
SNAPSHOT_PARTS = {name: kind for kind, names in _PARTS.items() for name in names}
"""Kind of each part, by name."""


def kind_of(path: str) -> PartKind:
    """Returns the kind of a value, given as its path of keys such as `packages.numpy`; unknown parts are notes."""
    return SNAPSHOT_PARTS.get(path.partition(".")[0], PartKind.NOTE)


def parts_of(*kinds: PartKind) -> tuple[str, ...]:
    """Returns the names of the parts of some kinds."""
    return tuple(name for kind in kinds for name in _PARTS[kind])
