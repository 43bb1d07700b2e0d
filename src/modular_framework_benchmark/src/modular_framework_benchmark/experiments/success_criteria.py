# SPDX-License-Identifier: BSD-3-Clause
"""Success criteria and milestones of the mode `task`: predicates on the world, with a short form for a pick."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_benchmark.predicates.conditions import HeldFor, Lifted
from modular_framework_benchmark.predicates.predicate import All, Predicate

DEFAULT_HEIGHT_M, DEFAULT_HOLD_S = 0.1, 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SuccessCriteria:
    """Success criteria for the final state of the world; without any, the outcome of the task suffices.

    The short form of a pick, `object` and `lifted`, stands for the predicates `lifted` and `held_for`.

    Attributes:
        object: Name of the object to be lifted and held; None for the first object.
        lifted: Minimum height above the initial height [m]; None for 0.1 m.
        hold_time: Simulated time between the end of the task and the check [s]; None for 2 s.
        shake: Simulated duration of the shake after the check [s]; None for no shake.
        required: Predicate that must hold at the check; None for the short form only.
    """

    object: str | None = None
    lifted: float | None = None
    hold_time: float | None = None
    shake: float | None = None
    required: Predicate | None = None

    @property
    def hold_s(self) -> float:
        """Returns the time before the check [s]; 0 without criteria."""
        if self == NO_CRITERIA:
            return 0.0
        return DEFAULT_HOLD_S if self.hold_time is None else self.hold_time

    @property
    def is_pick(self) -> bool:
        """Returns whether an object must be lifted and held."""
        has_short_form = self.object is not None or self.lifted is not None
        return has_short_form or self.required is None and self != NO_CRITERIA

    def predicate(self, target: str) -> All:
        """Returns the predicate that must hold at the check.

        Args:
            target: Name of the object of the short form.
        """
        height_m = DEFAULT_HEIGHT_M if self.lifted is None else self.lifted
        pick = (Lifted(object=target, height=height_m), HeldFor(object=target)) if self.is_pick else ()
        return All((*pick, *((self.required,) if self.required is not None else ())))


NO_CRITERIA = SuccessCriteria()
