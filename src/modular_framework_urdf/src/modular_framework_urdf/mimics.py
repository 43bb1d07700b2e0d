# SPDX-License-Identifier: BSD-3-Clause
"""Mimic joints: the leader at the end of each chain, and the leader's position for a position of the mimic joint."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: position = multiplier * leader + offset."""

    leader: str
    multiplier: float
    offset: float

    def leads_to(self, position: float) -> float:
        """Returns the leader's position [rad or m] that brings the joint to a position."""
        return (position - self.offset) / self.multiplier


def resolved(mimics: Mapping[str, Mimic], movable: Collection[str]) -> dict[str, Mimic]:
    """Returns what each joint follows that follows no other joint itself.

    Args:
        mimics: what each joint follows in the description.
        movable: names of all joints that move.

    Raises:
        ValueError: a joint follows one that does not move or is not there, joints follow each other in a loop, or a
            multiplier is 0 or a number is not finite.
    """
    independent = sorted(set(movable) - mimics.keys())
    result: dict[str, Mimic] = {}
    for name in mimics:
        way, found = [name], Mimic(name, 1.0, 0.0)
        while found.leader in mimics:
            direct = mimics[found.leader]
            if direct.leader in way:
                raise ValueError(
                    f"URDF joint '{name}': it mimics itself through {' -> '.join([*way, direct.leader])}; "
                    f"a joint may mimic one of {', '.join(independent) or 'none'}; let one of the loop "
                    "mimic none"
                )
            way.append(direct.leader)
            found = Mimic(
                direct.leader, found.multiplier * direct.multiplier, found.multiplier * direct.offset + found.offset
            )
        if not (math.isfinite(found.multiplier) and math.isfinite(found.offset) and found.multiplier):
            raise ValueError(
                f"URDF joint '{name}': it mimics '{found.leader}' by multiplier {found.multiplier} and "
                f"offset {found.offset}; both must be finite, the multiplier not 0; make a joint that "
                "never moves a fixed one"
            )
        if found.leader not in movable:
            raise ValueError(
                f"URDF joint '{way[-2]}': it mimics '{found.leader}', which is no joint that moves; "
                f"allowed are {', '.join(independent) or 'none'}; mend the name or remove <mimic>"
            )
        result[name] = found
    return result


def with_leaders(values: Mapping[str, float], mimics: Mapping[str, Mimic]) -> dict[str, float]:
    """Returns the positions with those of mimic joints replaced by their leaders'; a leader's own goes before.

    Args:
        values: positions by joint [rad or m].
        mimics: as `resolved` returns them.
    """
    result = {name: value for name, value in values.items() if name not in mimics}
    for name in values.keys() & mimics.keys():
        result.setdefault(mimics[name].leader, mimics[name].leads_to(values[name]))
    return result
