# SPDX-License-Identifier: BSD-3-Clause
"""Contacts between bodies, returned by collision checks and reported in errors and messages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LINK, ATTACHED, WORLD = "robot_link", "robot_attached", "world_object"


@dataclass(frozen=True, slots=True)
class Body:
    """Body of a collision geometry: a link, an attached object or a world object."""

    name: str
    kind: str
    link: str = ""
    touch_links: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Contact:
    """Contact of two bodies.

    Attributes:
        first: First body.
        second: Second body.
        depth: Penetration depth [m]; for pairs with a margin, the margin minus the distance.
        position: Position in the planning frame, shape (3,) [m].
        normal: Unit normal from the first to the second body in the planning frame, shape (3,).
    """

    first: Body
    second: Body
    depth: float
    position: NDArray[np.float64]
    normal: NDArray[np.float64]

    def describe(self) -> str:
        """Returns a text with the two bodies and the depth."""
        return f"{_label(self.first)} touches {_label(self.second)}, {self.depth * 1000.0:.1f} mm deep"


def _label(body: Body) -> str:
    if body.kind == LINK:
        return f"link '{body.name}'"
    return f"object '{body.name}'" + (f" held by '{body.link}'" if body.kind == ATTACHED else "")


def describe_contacts(contacts: Sequence[Contact], max_count: int = 4) -> str:
    """Returns a text with the first contacts, which are the deepest."""
    text = "; ".join(item.describe() for item in contacts[:max_count])
    return text + (f"; and {len(contacts) - max_count} more" if len(contacts) > max_count else "")
