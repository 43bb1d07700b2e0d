# SPDX-License-Identifier: BSD-3-Clause
"""Resolves chains of mimic joints and computes positions of leading joints."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mimic:
    """Relation of a mimic joint to its leading joint: position = multiplier * leader position + offset."""

    leader: str
    multiplier: float
    offset: float

    def leader_position(self, position: float) -> float:
        """Returns the leader's position for a position of the mimic joint [rad or m]."""
        return (position - self.offset) / self.multiplier

    def range_of(self, lower: float, upper: float) -> tuple[float, float]:
        """Returns the range of the joint while its leader moves from a lower to an upper position [rad or m]."""
        first, last = sorted(self.multiplier * position + self.offset for position in (lower, upper))
        return first, last


def resolve_mimics(mimics: Mapping[str, Mimic], movable_names: Collection[str]) -> dict[str, Mimic]:
    """Returns the relation of each mimic joint to an independent leading joint.

    Args:
        mimics: Relations as written in the URDF, by mimic joint.
        movable_names: Names of all movable joints.

    Raises:
        ValueError: A leading joint is unknown or not movable, the relations form a cycle, a multiplier is 0, or a
            number is not finite.
    """
    independent = sorted(set(movable_names) - mimics.keys())
    result: dict[str, Mimic] = {}
    for name in mimics:
        path, total = [name], Mimic(name, 1.0, 0.0)
        while total.leader in mimics:
            direct = mimics[total.leader]
            if direct.leader in path:
                raise ValueError(
                    f"URDF joint '{name}': it mimics itself through {' -> '.join([*path, direct.leader])}; "
                    f"a joint may mimic one of {', '.join(independent) or 'none'}; remove <mimic> from a joint of the "
                    "cycle"
                )
            path.append(direct.leader)
            total = Mimic(
                direct.leader, total.multiplier * direct.multiplier, total.multiplier * direct.offset + total.offset
            )
        if not (math.isfinite(total.multiplier) and math.isfinite(total.offset) and total.multiplier):
            raise ValueError(
                f"URDF joint '{name}': it mimics '{total.leader}' by multiplier {total.multiplier} and "
                f"offset {total.offset}; both must be finite, the multiplier not 0; make a joint that "
                "never moves fixed"
            )
        if total.leader not in movable_names:
            raise ValueError(
                f"URDF joint '{path[-2]}': it mimics '{total.leader}', which is not a movable joint; "
                f"allowed: {', '.join(independent) or 'none'}; correct the name or remove <mimic>"
            )
        result[name] = total
    return result


def with_leaders(values: Mapping[str, float], mimics: Mapping[str, Mimic]) -> dict[str, float]:
    """Returns joint positions with mimic joints replaced by their leaders.

    If `values` contains a leader, that position takes precedence.

    Args:
        values: Positions by joint [rad or m].
        mimics: Relations from `resolve_mimics`.
    """
    result = {name: value for name, value in values.items() if name not in mimics}
    for name in values.keys() & mimics.keys():
        result.setdefault(mimics[name].leader, mimics[name].leader_position(values[name]))
    return result
