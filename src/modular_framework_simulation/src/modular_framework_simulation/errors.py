# SPDX-License-Identifier: BSD-3-Clause
"""The errors this package raises, so that the ROS interface can turn every one of them into a status message."""


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
        listed = ", ".join(sorted(known)) or "none"
        super().__init__(f"there is no {kind} '{name}' in the simulated world; known: {listed}")
        self.kind = kind
        self.name = name


class DuplicateModelError(SimulationError):
    """A model was to be spawned under a name that is taken."""

    def __init__(self, name: str) -> None:
        super().__init__(f"a model '{name}' is already in the simulated world; delete it first or use another name")
        self.name = name


class LoopTimeoutError(SimulationError):
    """The simulation loop did not process a request in time."""


class PlanningSceneError(SimulationError):
    """The planning scene cannot be brought in step with the simulated world."""
