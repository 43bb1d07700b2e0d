# SPDX-License-Identifier: BSD-3-Clause
"""A state that selects the next object of a tower and the object below it."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError
from modular_framework_states.object_series import SeriesError, object_series, scene_objects

OBJECT_KEY, SUPPORT_KEY = "selected_object", "selected_support"


class NextInTower(FrameworkState):
    """Selects the objects of a tower one after the other, from the bottom; positive while an object is left.

    The tower consists of the objects of the planning scene that are named ``<prefix>_1``, ``<prefix>_2``, and so on.
    The first object is the base, on which the second object is put. After the last object, the outcome is the second of
    three outcomes, or the negative outcome of two.

    Args:
        prefix: Common part of the objects' names.
        **keys: Outcomes and userdata keys of any state; the output key ``selected_object`` receives the name of the
            next object, and ``selected_support`` the name of the object below it.
    """

    def __init__(self, prefix: Annotated[str, Named("series")], **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._prefix = str(prefix)
        self._left: list[tuple[str, str]] | None = None  # None before the first object of a tower

    def execute(self, userdata: Any) -> str:
        """Selects the next object and its support."""
        missing = {OBJECT_KEY, SUPPORT_KEY} - set(self.get_registered_output_keys())
        if missing:
            return self.fail(f"the output keys lack {', '.join(sorted(missing))}; add them, or the names are lost")
        try:
            if self._left is None:
                names = object_series(self._prefix, scene_objects())
                self._left = list(zip(names[1:], names, strict=False))
        except (CallError, SeriesError) as error:
            return self.fail(str(error))
        if not self._left:
            self._left = None
            return self.end(self.outcomes[1], f"the tower of '{self._prefix}' has no further object")
        userdata.selected_object, userdata.selected_support = self._left.pop(0)
        return self.succeed()
