# SPDX-License-Identifier: BSD-3-Clause
"""Says in one sentence which bodies touch."""
from __future__ import annotations

from collections.abc import Sequence

from modular_framework_planning.collision_detection.collision_checker import Contact


def describe_contacts(contacts: Sequence[Contact], most: int = 4) -> str:
    """Joins the deepest contacts into one sentence."""
    text = "; ".join(item.describe() for item in contacts[:most])
    return text + (f"; and {len(contacts) - most} more" if len(contacts) > most else "")
