# SPDX-License-Identifier: BSD-3-Clause
"""What an episode ran with, as the running nodes said; not what its experiment file names."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class WhatRan:
    """The parts of an episode; those that a mode does not have are empty.

    Attributes:
        planners: Settings and implementation of each planner, by its name and that of its pipeline.
        solver: Inverse kinematics, in the mode that measures it.
        methods: Version and SHA-256 of the sources of each method that generates grasps, by package.
        controllers: Type of each controller that ran, by name.
        physics_engine: What moved the bodies.
        renderer: What drew the images of cameras; empty without a camera.
        digests: SHA-256 of the robot description, the world and the task, by what they are.
        substitutions: What ran in place of what was named, as documented: constrained plans of CBiRRT.
        replaced: What was named and is not there, with what ran instead: such an episode is invalid.
    """

    planners: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    solver: str = ""
    methods: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    controllers: Mapping[str, str] = field(default_factory=dict)
    physics_engine: str = ""
    renderer: str = ""
    digests: Mapping[str, str] = field(default_factory=dict)
    substitutions: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()


IMPLEMENTATION = "implementation"
"""Who searched for a planner: `compiled`, `OMPL`, `CBiRRT`; empty where straight motions were enough."""
CONSTRAINED = "CBiRRT"
"""The search of plans whose path constraints no other planner can keep."""


def planners_of(runs: Iterable[Mapping[str, Any] | None]) -> dict[str, Any]:
    """Returns the fields of `WhatRan` that planning reports fill.

    Args:
        runs: The key `run` of each report; None where a request was refused before.
    """
    planners: dict[str, dict[str, Any]] = {}
    searched: dict[str, set[str]] = {}
    substitutions, replaced = set(), set()
    for run in filter(None, runs):
        by, name = run["implementation"], f"{run['planner']} of {run['pipeline']}"
        planners[name] = {**run["settings"], "request_adapters": ", ".join(run["adapters"])}
        searched.setdefault(name, set()).update({by} - {""})
        if by == CONSTRAINED != run["planner"]:
            substitutions.add(f"{by} for {run['planner']}, which cannot keep path constraints")
        if run["replaced"]:
            replaced.add(f"planner '{run['replaced']}' was named, and {run['planner']} planned")
    for name in planners:
        planners[name][IMPLEMENTATION] = ", ".join(sorted(searched[name]))
    return {
        "planners": planners,
        "substitutions": tuple(sorted(substitutions)),
        "replaced": tuple(sorted(replaced)),
    }


def description_digests(urdf: str, srdf: str) -> dict[str, str]:
    """Returns SHA-256 of the texts that describe a robot, hexadecimal, by what they are; without empty ones."""
    texts = {"robot description": urdf, "semantic description": srdf}
    return {what: hashlib.sha256(text.encode()).hexdigest() for what, text in texts.items() if text}
