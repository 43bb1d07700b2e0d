# SPDX-License-Identifier: BSD-3-Clause
"""Records of made-up worlds for tests of predicates, in the form of the simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.spatial.transform import Rotation

from modular_framework_benchmark.predicates.stages import SimulatedStage
from modular_framework_benchmark.predicates.world_track import read_world

TABLE = [[-0.5, -0.3, 0.0], [0.5, 0.3, 0.8]]
CUBE = [[-0.02, -0.02, -0.03], [0.02, 0.02, 0.03]]
BOXES = {"table": TABLE, "cube": CUBE, "lid": CUBE, "bin": [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.1]]}
STANDING_M = 0.83
"""Height at which a cube stands on the table."""


def state(
    xyz: Sequence[float], rpy: Sequence[float] = (0.0, 0.0, 0.0), joints: Mapping[str, float] | None = None
) -> list[Any]:
    """Returns the state of a model at rest."""
    return [*xyz, *Rotation.from_euler("xyz", rpy).as_quat(), *[0.0] * 6, dict(joints or {})]


def sample(
    time_s: float,
    states: Mapping[str, Any] | None = None,
    contacts: Sequence[Sequence[str]] | None = None,
    held: Sequence[str] | None = None,
) -> list[Any]:
    """Returns a sample; None for contacts and held objects that did not change."""
    return [time_s, dict(states or {}), contacts, held]


def stage_of(*samples: list[Any], started_s: float = 0.0) -> SimulatedStage:
    """Returns the stage of a record with one robot."""
    record = {"samples": list(samples), "boxes": BOXES, "robots": ["arm"]}
    return SimulatedStage(read_world(record, 0.0, started_s, float("inf")))
