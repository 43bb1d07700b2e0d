# SPDX-License-Identifier: BSD-3-Clause
"""Decides whether simulated time may pass: nodes hold it while they compute, so that computing takes none of it.

While anybody holds time it passes only while a controller carries out a goal, or while somebody asks for it. Both end
in a known physics step, whatever the load of the machine. A hold ends by itself when its owner does not renew it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

LONGEST_LEASE_S = 600.0
LONGEST_SILENCE_S = 60.0
"""Time that is held, but not during motions, passes again after so much real time without a goal or a request [s]: a
node that waits for simulated time without asking for it would wait for ever."""

Log = Callable[[str], None]


class HoldError(ValueError):
    """A hold is not possible as asked for."""


@dataclass(frozen=True, slots=True)
class Hold:
    """One hold.

    Attributes:
        during_motions: time stands still while controllers carry out goals, too.
        lease_s: real time from one renewal to the next, at most [s].
        end_s: when it ends by itself [s of the clock].
    """

    during_motions: bool
    lease_s: float
    end_s: float

    def is_over(self, now_s: float) -> bool:
        """Whether it has ended by itself."""
        return now_s > self.end_s


@dataclass(frozen=True, slots=True)
class Advance:
    """A request for time to pass.

    Attributes:
        step: physics step at which it has passed.
        passed: set then, or when the world begins again.
    """

    step: int
    passed: threading.Event


class TimeHolds:
    """The holds of simulated time, and the requests for it to pass; used by one thread, that of the loop.

    Args:
        log: takes a line about a hold that ended by itself, or that keeps the world waiting.
        clock: real time [s].
    """

    def __init__(self, log: Log, clock: Callable[[], float] = time.monotonic) -> None:
        self._log, self._clock = log, clock
        self._holds: dict[str, Hold] = {}
        self._advances: list[Advance] = []
        self._active_s = clock()
        self._complained = False

    @property
    def owners(self) -> tuple[str, ...]:
        """Who holds time."""
        return tuple(self._holds)

    def hold(self, owner: str, lease_s: float, during_motions: bool = False) -> None:
        """Begins or renews a hold.

        Args:
            owner: whose it is; a second hold of the same owner takes the place of the first.
            lease_s: after so much real time it ends by itself [s].
            during_motions: whether time stands still while controllers carry out goals, too.

        Raises:
            HoldError: there is no owner, or the lease is out of range.
        """
        if not owner:
            raise HoldError("a hold of simulated time needs the name of its owner")
        if not 0.0 < lease_s <= LONGEST_LEASE_S:
            raise HoldError(f"lease_s is {lease_s}; allowed is more than 0 and at most {LONGEST_LEASE_S:g} s")
        if owner not in self._holds:
            self.note_activity()
        self._holds[owner] = Hold(during_motions, lease_s, self._clock() + lease_s)

    def release(self, owner: str) -> bool:
        """Ends a hold; returns whether there was one."""
        self.note_activity()
        return self._holds.pop(owner, None) is not None

    def advance(self, step: int) -> Advance:
        """Asks for time to pass until a physics step."""
        self.note_activity()
        asked = Advance(step, threading.Event())
        self._advances.append(asked)
        return asked

    def give_up(self, asked: Advance) -> None:
        """Withdraws a request for time to pass."""
        self._advances = [other for other in self._advances if other is not asked]

    def restart(self) -> None:
        """Ends the requests for time to pass: the world begins again."""
        for asked in self._advances:
            asked.passed.set()
        self._advances.clear()
        self.note_activity()

    def note_activity(self) -> None:
        """Notes that somebody does something with the world."""
        self._active_s, self._complained = self._clock(), False

    def may_pass(self, step: int, moving: bool) -> bool:
        """Returns whether the next physics step may be made.

        Args:
            step: number of steps made.
            moving: whether a controller carries out a goal.
        """
        for asked in [asked for asked in self._advances if asked.step <= step]:
            asked.passed.set()
            self.give_up(asked)
            self.note_activity()
        if not self._holds:
            return True
        self._end_expired()
        if any(hold.during_motions for hold in self._holds.values()):
            self.note_activity()
            return False
        if moving:
            self.note_activity()
        return not self._holds or moving or bool(self._advances) or self._silent()

    def _end_expired(self) -> None:
        now_s = self._clock()
        for owner, hold in list(self._holds.items()):
            if hold.is_over(now_s):
                del self._holds[owner]
                self._log(
                    f"'{owner}' held simulated time and has not renewed that for {hold.lease_s:g} s: its hold is over"
                )

    def _silent(self) -> bool:
        """Returns whether nothing happened for so long that somebody seems to wait for time without asking for it."""
        if self._clock() - self._active_s < LONGEST_SILENCE_S:
            return False
        if not self._complained:
            self._complained = True
            self._log(
                f"simulated time passes although {', '.join(self._holds)} hold it: nothing was asked of the world for "
                f"{LONGEST_SILENCE_S:g} s. A node that waits for simulated time has to ask for it (AdvanceTime); what "
                "follows is not repeatable"
            )
        return True
