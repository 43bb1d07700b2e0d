# SPDX-License-Identifier: BSD-3-Clause
"""Decides whether simulated time may advance; nodes hold time while they compute.

While a node holds time, simulated time advances only during the goals of controllers, or on request. A goal or request
ends in a defined physics step, independent of the load of the machine. A hold expires unless its owner renews the hold.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

MAX_LEASE_S = 600.0
MAX_IDLE_S = 60.0
"""Real time without a goal or request after which held time advances again [s], unless it is held during motions; a
node that waits for simulated time without a request would otherwise wait forever."""

Log = Callable[[str], None]


class HoldError(ValueError):
    """A hold is invalid."""


@dataclass(frozen=True, slots=True)
class Hold:
    """A hold of simulated time.

    Attributes:
        during_motions: Whether time is also held during the goals of controllers.
        lease_s: Maximum real time between two renewals [s].
        end_s: Clock time of the expiry [s].
    """

    during_motions: bool
    lease_s: float
    end_s: float

    def is_over(self, now_s: float) -> bool:
        """Returns whether the hold has expired."""
        return now_s > self.end_s


@dataclass(frozen=True, slots=True)
class Advance:
    """A request to advance time.

    Attributes:
        step: Number of the physics step at which the request is complete.
        passed: Event that is set on completion, or when the world restarts.
    """

    step: int
    passed: threading.Event


class TimeHolds:
    """Holds of simulated time and requests to advance time; only used by the loop's thread.

    Args:
        log: Function that logs an expired hold, or a hold that blocks the world.
        clock: Function that returns real time [s].
    """

    def __init__(self, log: Log, clock: Callable[[], float] = time.monotonic) -> None:
        self._log, self._clock = log, clock
        self._holds: dict[str, Hold] = {}
        self._advances: list[Advance] = []
        self._last_activity_s = clock()
        self._warned = False

    @property
    def owners(self) -> tuple[str, ...]:
        """Returns the owners of all holds."""
        return tuple(self._holds)

    def hold(self, owner: str, lease_s: float, during_motions: bool = False) -> None:
        """Starts or renews a hold.

        Args:
            owner: Name of the owner; a second hold of the same owner replaces the first.
            lease_s: Real time until the hold expires [s].
            during_motions: Whether time is also held during the goals of controllers.

        Raises:
            HoldError: The name of the owner is empty, or the lease is out of range.
        """
        if not owner:
            raise HoldError("a hold of simulated time needs the name of its owner")
        if not 0.0 < lease_s <= MAX_LEASE_S:
            raise HoldError(f"lease_s is {lease_s}; allowed: more than 0 and at most {MAX_LEASE_S:g} s")
        if owner not in self._holds:
            self.note_activity()
        self._holds[owner] = Hold(during_motions, lease_s, self._clock() + lease_s)

    def release(self, owner: str) -> bool:
        """Ends a hold; returns whether the owner had a hold."""
        self.note_activity()
        return self._holds.pop(owner, None) is not None

    def advance(self, step: int) -> Advance:
        """Requests that time advances until a physics step."""
        self.note_activity()
        request = Advance(step, threading.Event())
        self._advances.append(request)
        return request

    def give_up(self, request: Advance) -> None:
        """Withdraws a request to advance time."""
        self._advances = [other for other in self._advances if other is not request]

    def restart(self) -> None:
        """Completes all requests to advance time, because the world restarts."""
        for request in self._advances:
            request.passed.set()
        self._advances.clear()
        self.note_activity()

    def note_activity(self) -> None:
        """Records that a node uses the world."""
        self._last_activity_s, self._warned = self._clock(), False

    def may_pass(self, step: int, moving: bool) -> bool:
        """Returns whether the next physics step may run.

        Args:
            step: Number of completed steps.
            moving: Whether a controller executes a goal.
        """
        for request in [request for request in self._advances if request.step <= step]:
            request.passed.set()
            self.give_up(request)
            self.note_activity()
        if not self._holds:
            return True
        self._end_expired()
        if any(hold.during_motions for hold in self._holds.values()):
            self.note_activity()
            return False
        if moving:
            self.note_activity()
        return not self._holds or moving or bool(self._advances) or self._idle_too_long()

    def _end_expired(self) -> None:
        now_s = self._clock()
        for owner, hold in list(self._holds.items()):
            if hold.is_over(now_s):
                del self._holds[owner]
                self._log(
                    f"the hold of simulated time by '{owner}' has expired: it was not renewed for {hold.lease_s:g} s"
                )

    def _idle_too_long(self) -> bool:
        """Returns whether the world was unused for so long that a node probably waits for time without a request."""
        if self._clock() - self._last_activity_s < MAX_IDLE_S:
            return False
        if not self._warned:
            self._warned = True
            self._log(
                f"simulated time advances although {', '.join(self._holds)} hold it, because no node used the world "
                f"for {MAX_IDLE_S:g} s. A node that waits for simulated time must request it (AdvanceTime); the run "
                "is not repeatable from here on"
            )
        return True
