# SPDX-License-Identifier: BSD-3-Clause
"""Distinguishes fingers that an object stopped from fingers that had too little torque to move."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from modular_framework_core.grasping.grasp_server import Outcome

MOVED_SHARE = 0.2
"""Fingers count as moved beyond this share of the tolerance."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """A motion of the fingers, as it was commanded.

    Attributes:
        begun: {joint: position} before the motion [rad or m].
        targets: {joint: position} commanded [rad or m].
        efforts: {joint: greatest effort} [N m or N]; one that is missing is the controller's own.
    """

    begun: Mapping[str, float]
    targets: Mapping[str, float]
    efforts: Mapping[str, float]

    def direction(self, joint: str) -> float:
        """Returns which way a joint was to move: 1.0 or -1.0."""
        return math.copysign(1.0, self.targets[joint] - self.begun.get(joint, self.targets[joint]))

    def effort(self, joint: str) -> float:
        """Returns the greatest effort of a joint; the controller's own counts as unlimited."""
        return self.efforts.get(joint, math.inf)


class StallEvidence:
    """Judges stalls by the earlier motions of the fingers.

    Args:
        tolerance: Greatest distance that counts as reached [rad or m]; it has to be a small share of the joints'
            ranges, since within it neither their motion nor a shut hand can be detected.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._held: Outcome | None = None
        self._moving_efforts: dict[tuple[str, float], float] = {}

    def judge(self, outcome: Outcome, attempt: Attempt) -> Outcome:
        """Accepts a stall only when it was not a lack of torque that kept the fingers from moving.

        Some joint short of its target must have moved toward it, or press, or still hold since the stall
        before, or have moved this way earlier with no more effort: then a new object stops it.

        Args:
            outcome: Result reported by the controller.
            attempt: What was commanded.

        Returns:
            The outcome; not stalled, and with the reason, when none of that holds.
        """
        judged = outcome
        if outcome.stalled and not (
            outcome.pressing
            or self._still_holds(attempt)
            or any(self._was_stopped(name, outcome, attempt) for name in attempt.targets)
        ):
            judged = replace(
                outcome,
                stalled=False,
                text="the fingers have not moved, so nothing shows that something "
                "stopped them; give them more torque, or begin farther open"
                f"{'; ' + outcome.text if outcome.text else ''}",
            )
        self._held = judged if judged.stalled else None
        self._remember(outcome, attempt)
        return judged

    def _still_holds(self, attempt: Attempt) -> bool:
        held = self._held
        return held is not None and all(
            abs(held.positions.get(name, math.inf) - attempt.begun.get(name, math.inf)) <= self._tolerance
            for name in attempt.targets
        )

    def _was_stopped(self, name: str, outcome: Outcome, attempt: Attempt) -> bool:
        if (
            name not in attempt.begun
            or name not in outcome.positions
            or (abs(attempt.targets[name] - outcome.positions[name]) <= self._tolerance)
        ):
            return False
        return self._moved(name, outcome, attempt) or attempt.effort(name) >= self._moving_efforts.get(
            (name, attempt.direction(name)), math.nan
        )

    def _moved(self, name: str, outcome: Outcome, attempt: Attempt) -> bool:
        if name not in attempt.begun or name not in outcome.positions:
            return False
        way = attempt.direction(name) * (outcome.positions[name] - attempt.begun[name])
        return way > MOVED_SHARE * self._tolerance

    def _remember(self, outcome: Outcome, attempt: Attempt) -> None:
        for name in attempt.targets:
            if self._moved(name, outcome, attempt):
                key = (name, attempt.direction(name))
                self._moving_efforts[key] = min(attempt.effort(name), self._moving_efforts.get(key, math.inf))
