# SPDX-License-Identifier: BSD-3-Clause
"""Errors of this package; the ROS interface converts each error into a status message."""

from modular_framework_ros.allowed_names import nearest

MAX_NAME_LENGTH = 100
"""Maximum number of characters of a name in a message."""
MAX_LISTED_NAMES = 50
"""Maximum number of names in a message."""


class SimulationError(Exception):
    """Base of all errors of the simulation."""


class DescriptionError(SimulationError):
    """A world, model or robot description cannot be used.

    Args:
        location: File, line and element at fault.
        problem: Invalid content.
        allowed: Accepted content, and the action to take.
    """

    def __init__(self, location: str, problem: str, allowed: str) -> None:
        super().__init__(f"{location}: {problem}; {allowed}")
        self.location = location
        self.problem = problem
        self.allowed = allowed


class UnknownEntityError(SimulationError):
    """The world has no model, link or joint of a requested name.

    Args:
        kind: Kind of the missing entity: "model", "link" or "joint".
        name: Requested name.
        known: Existing names.
    """

    def __init__(self, kind: str, name: str, known: list[str]) -> None:
        super().__init__(
            f"there is no {kind} '{_short_name(name)}' in the simulated world; "
            f"known: {_name_list(known)}{nearest(name, known)}"
        )
        self.kind = kind
        self.name = name


class AmbiguousNameError(SimulationError):
    """Several models have a link or joint of a requested name.

    Args:
        kind: Kind of the entities: "link" or "joint".
        name: Requested name.
        found: Full names of all matching entities.
    """

    def __init__(self, kind: str, name: str, found: list[str]) -> None:
        super().__init__(
            f"{len(found)} models have a {kind} '{_short_name(name)}'; name the model too: {_name_list(found)}"
        )
        self.kind = kind
        self.name = name


def _short_name(name: str) -> str:
    return name if len(name) <= MAX_NAME_LENGTH else f"{name[:MAX_NAME_LENGTH]}..."


def _name_list(names: list[str]) -> str:
    shown = sorted(names)[:MAX_LISTED_NAMES]
    more = len(names) - len(shown)
    return (", ".join(shown) or "none") + (f" and {more} more" if more else "")


class ModelChangeError(SimulationError):
    """A model cannot be changed as requested."""


class DuplicateModelError(SimulationError):
    """The name of a new model is already in use."""

    def __init__(self, name: str) -> None:
        super().__init__(f"a model '{name}' is already in the simulated world; delete it first or use another name")
        self.name = name


class LoopTimeoutError(SimulationError):
    """The simulation loop did not process a request in time."""


class PlanningSceneError(SimulationError):
    """The planning scene cannot be synchronized with the simulated world."""
