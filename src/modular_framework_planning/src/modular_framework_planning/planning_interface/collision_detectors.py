# SPDX-License-Identifier: BSD-3-Clause
"""Finds collision checkers by what the parameter `collision_detector` calls them: MoveIt's names, or `module/Class`.

Nothing else in the package chooses a checker: classes that need one receive a factory.
"""

from __future__ import annotations

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.errors import ModelError
from modular_framework_planning.planning_interface.collision_checker import CollisionCheckerFactory
from modular_framework_planning.planning_interface.plugin_classes import plugin_class

DEFAULT_COLLISION_DETECTOR = "FCL"
# MoveIt's names of its checkers all mean the one whose verdicts are exact.
COLLISION_DETECTORS: dict[str, CollisionCheckerFactory] = {
    "FCL": ExactCollisionChecker,
    "Bullet": ExactCollisionChecker,
    "HYBRID": ExactCollisionChecker,
}
DEFAULT_CHECKER = COLLISION_DETECTORS[DEFAULT_COLLISION_DETECTOR]
SHIPPED = {key.lower(): factory for key, factory in COLLISION_DETECTORS.items()}
METHODS = ("build", "is_free", "path_is_free", "colliding_state", "contacts", "fixed_contacts", "distance")


def is_known(name: str) -> bool:
    """Whether this is a name of COLLISION_DETECTORS, in capitals or not, or empty for the default."""
    return not name or name.lower() in SHIPPED


def collision_detector(name: str = DEFAULT_COLLISION_DETECTOR) -> CollisionCheckerFactory:
    """Returns the factory of a kind of checkers.

    Args:
        name: a name of COLLISION_DETECTORS, in capitals or not, or `module/Class` of a class whose instances have
            the methods of CollisionChecker; empty for the default.

    Raises:
        ModelError: there is no such class, or it lacks methods; lists the checkers there are.
    """
    known = f"known are {', '.join(COLLISION_DETECTORS)} and module/Class with the methods of CollisionChecker"
    if is_known(name):
        return SHIPPED[(name or DEFAULT_COLLISION_DETECTOR).lower()]
    kind: CollisionCheckerFactory = plugin_class(name, f"collision_detector '{name}'", known)
    missing = [method for method in METHODS if not callable(getattr(kind, method, None))]
    if missing:
        raise ModelError(f"collision_detector '{name}': no method {', '.join(missing)}; {known}")
    return kind
