# SPDX-License-Identifier: BSD-3-Clause
"""Distinguishes fingers that an object blocks from fingers with too little torque to move."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from modular_framework_core.grasping.grasp_server import Outcome

MOVED_FRACTION = 0.2
"""Minimum displacement that counts as motion, as a fraction of the position tolerance."""


@dataclass(frozen=True, slots=True)
class CommandedMotion:
    """Commanded motion of the fingers.

    Attributes:
        start_positions: Joint positions before the motion, by name [rad or m].
        targets: Commanded joint positions, by name [rad or m].
        efforts: Effort limits by joint name [Nm or N]; for other joints, the controller chooses the effort.
    """

    start_positions: Mapping[str, float]
    targets: Mapping[str, float]
    efforts: Mapping[str, float]

    def direction(self, joint: str) -> float:
        """Returns the direction of the commanded motion of a joint, 1.0 or -1.0."""
        return math.copysign(1.0, self.targets[joint] - self.start_positions.get(joint, self.targets[joint]))

    def effort(self, joint: str) -> float:
        """Returns the effort limit of a joint; infinite if the controller chooses the effort."""
        return self.efforts.get(joint, math.inf)


class StallEvidence:
    """Checks stalls against earlier motions of the fingers.

    Args:
        tolerance: Position tolerance [rad or m]. The tolerance must be small compared with the joint ranges, because
            smaller motions are not detected.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._held: Outcome | None = None
        self._moving_efforts: dict[tuple[str, float], float] = {}

    def judge(self, outcome: Outcome, attempt: CommandedMotion) -> Outcome:
        """Rejects a stall that a lack of torque may have caused.

        A stall is accepted if the controller reports a pressing force, or if the fingers still hold the object of the
        last stall. It is also accepted if a joint stopped short of its target, and either moved towards the target now,
        or moved in this direction before with the same or less effort.

        Args:
            outcome: Result reported by the controller.
            attempt: Commanded motion.

        Returns:
            The outcome; for a rejected stall, `stalled` is False and `text` gives the reason.
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
                text="the fingers have not moved, so a lack of torque may be the cause; "
                "increase the torque, or start with wider open fingers"
                f"{'; ' + outcome.text if outcome.text else ''}",
            )
        self._held = judged if judged.stalled else None
        self._remember(outcome, attempt)
        return judged

    def _still_holds(self, attempt: CommandedMotion) -> bool:
        held = self._held
        return held is not None and all(
            abs(held.positions.get(name, math.inf) - attempt.start_positions.get(name, math.inf)) <= self._tolerance
            for name in attempt.targets
        )

    def _was_stopped(self, name: str, outcome: Outcome, attempt: CommandedMotion) -> bool:
        if (
            name not in attempt.start_positions
            or name not in outcome.positions
            or (abs(attempt.targets[name] - outcome.positions[name]) <= self._tolerance)
        ):
            return False
        return self._has_moved(name, outcome, attempt) or attempt.effort(name) >= self._moving_efforts.get(
            (name, attempt.direction(name)), math.nan
        )

    def _has_moved(self, name: str, outcome: Outcome, attempt: CommandedMotion) -> bool:
        if name not in attempt.start_positions or name not in outcome.positions:
            return False
        distance = attempt.direction(name) * (outcome.positions[name] - attempt.start_positions[name])
        return distance > MOVED_FRACTION * self._tolerance

    def _remember(self, outcome: Outcome, attempt: CommandedMotion) -> None:
        for name in attempt.targets:
            if self._has_moved(name, outcome, attempt):
                key = (name, attempt.direction(name))
                self._moving_efforts[key] = min(attempt.effort(name), self._moving_efforts.get(key, math.inf))
