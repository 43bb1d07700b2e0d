# SPDX-License-Identifier: BSD-3-Clause
"""How long the parts of a plan took."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

SETUP, GOALS, SEARCH, REPAIR, SHORTENING, TIMING, CHECK = (
    "setup",
    "goals",
    "search",
    "repair",
    "shortening",
    "timing",
    "check",
)


class PhaseTimes:
    """Adds up the seconds of each part; a part inside another one counts for itself alone."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inner = [0.0]  # time of the parts inside each open part

    @contextmanager
    def measured(self, phase: str) -> Iterator[None]:
        """Adds the time that the block takes to a part, also where it raises an exception."""
        begun = time.monotonic()
        self._inner.append(0.0)
        try:
            yield
        finally:
            spent = time.monotonic() - begun
            self.seconds[phase] = self.seconds.get(phase, 0.0) + spent - self._inner.pop()
            self._inner[-1] += spent
