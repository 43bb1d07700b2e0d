# SPDX-License-Identifier: BSD-3-Clause
"""Contacts between bodies, as collision checks return them, errors carry them and messages report them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LINK, ATTACHED, WORLD = "robot_link", "robot_attached", "world_object"


@dataclass(frozen=True, slots=True)
class Body:
    """The body that a collision geometry belongs to."""

    name: str
    kind: str
    link: str = ""
    touch_links: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Contact:
    """Two bodies that touch; position [m] and normal (from first to second) in the planning frame, depth [m].

    Where a distance has to be kept, touching means being closer, and the depth is what is missing.
    """

    first: Body
    second: Body
    depth: float
    position: NDArray[np.float64]
    normal: NDArray[np.float64]

    def describe(self) -> str:
        """Says which body touches which and how deep."""
        return f"{_label(self.first)} touches {_label(self.second)}, {self.depth * 1000.0:.1f} mm deep"


def _label(body: Body) -> str:
    if body.kind == LINK:
        return f"link '{body.name}'"
    return f"object '{body.name}'" + (f" held by '{body.link}'" if body.kind == ATTACHED else "")


def describe_contacts(contacts: Sequence[Contact], most: int = 4) -> str:
    """Joins the deepest contacts into one sentence."""
    text = "; ".join(item.describe() for item in contacts[:most])
    return text + (f"; and {len(contacts) - most} more" if len(contacts) > most else "")
