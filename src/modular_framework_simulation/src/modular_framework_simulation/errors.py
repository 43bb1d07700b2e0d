# SPDX-License-Identifier: BSD-3-Clause
"""The errors this package raises, so that the ROS interface can turn every one of them into a status message."""

from modular_framework_ros.allowed_names import nearest

LONGEST_NAME = 100
"""Characters of a name that a message shows at most."""
LONGEST_LIST = 50
"""Names that a message lists at most."""


class SimulationError(Exception):
    """Base of all errors of the simulation."""


class DescriptionError(SimulationError):
    """A world, model or robot description cannot be used.

    Args:
        where: File, line and element at fault.
        problem: What was found.
        allowed: What would have been accepted and what to do about it.
    """

    def __init__(self, where: str, problem: str, allowed: str) -> None:
        super().__init__(f"{where}: {problem}; {allowed}")
        self.where = where
        self.problem = problem
        self.allowed = allowed


class UnknownEntityError(SimulationError):
    """The world has no model, link or joint of a requested name.

    Args:
        kind: What was not found: "model", "link" or "joint".
        name: The requested name.
        known: The names that exist.
    """

    def __init__(self, kind: str, name: str, known: list[str]) -> None:
        super().__init__(
            f"there is no {kind} '{_shown(name)}' in the simulated world; known: {_listed(known)}{nearest(name, known)}"
        )
        self.kind = kind
        self.name = name


class AmbiguousNameError(SimulationError):
    """Several models have a link or joint of a requested name.

    Args:
        kind: What was meant: "link" or "joint".
        name: The requested name.
        found: The full names of all that have it.
    """

    def __init__(self, kind: str, name: str, found: list[str]) -> None:
        super().__init__(f"{len(found)} models have a {kind} '{_shown(name)}'; name the model too: {_listed(found)}")
        self.kind = kind
        self.name = name


def _shown(name: str) -> str:
    return name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."


def _listed(names: list[str]) -> str:
    shown = sorted(names)[:LONGEST_LIST]
    more = len(names) - len(shown)
    return (", ".join(shown) or "none") + (f" and {more} more" if more else "")


class ModelChangeError(SimulationError):
    """A model cannot be changed as asked for."""


class DuplicateModelError(SimulationError):
    """A model was to be spawned under a name that is taken."""

    def __init__(self, name: str) -> None:
        super().__init__(f"a model '{name}' is already in the simulated world; delete it first or use another name")
        self.name = name


class LoopTimeoutError(SimulationError):
    """The simulation loop did not process a request in time."""


class PlanningSceneError(SimulationError):
    """The planning scene cannot be brought in step with the simulated world."""
