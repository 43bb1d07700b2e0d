# SPDX-License-Identifier: BSD-3-Clause
"""Collision checker selection by the parameter `collision_detector`: a MoveIt name or `module/Class`.

Only this module chooses a checker; classes that need a checker receive a factory.
"""

from __future__ import annotations

from typing import Any

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.errors import ModelError
from modular_framework_planning.planning_interface.collision_checker import CollisionCheckerFactory
from modular_framework_planning.planning_interface.plugin_classes import plugin_class
from modular_framework_ros.allowed_names import nearest

DEFAULT_COLLISION_DETECTOR = "FCL"
# All MoveIt names select the exact checker.
COLLISION_DETECTORS: dict[str, CollisionCheckerFactory] = {
    "FCL": ExactCollisionChecker,
    "Bullet": ExactCollisionChecker,
    "HYBRID": ExactCollisionChecker,
}
DEFAULT_CHECKER = COLLISION_DETECTORS[DEFAULT_COLLISION_DETECTOR]
DETECTORS_BY_NAME = {key.lower(): factory for key, factory in COLLISION_DETECTORS.items()}
METHODS = ("build", "is_free", "path_is_free", "colliding_state", "contacts", "fixed_contacts", "distance")


def is_detector_name(name: str) -> bool:
    """Checks whether a name is a key of COLLISION_DETECTORS, in any case, or empty for the default."""
    return not name or name.lower() in DETECTORS_BY_NAME


def collision_detector(name: str = DEFAULT_COLLISION_DETECTOR) -> CollisionCheckerFactory:
    """Returns the factory of a collision checker.

    Args:
        name: Key of COLLISION_DETECTORS, in any case, or `module/Class` of a class with the methods of
            CollisionChecker; empty for the default.

    Raises:
        ModelError: The class does not exist or lacks methods; lists the allowed names.
    """
    allowed = f"allowed: {', '.join(COLLISION_DETECTORS)} and module/Class with the methods of CollisionChecker"
    allowed += nearest(name, COLLISION_DETECTORS)
    if is_detector_name(name):
        return DETECTORS_BY_NAME[(name or DEFAULT_COLLISION_DETECTOR).lower()]
    kind: CollisionCheckerFactory = plugin_class(name, f"collision_detector '{name}'", allowed)
    missing = [method for method in METHODS if not callable(getattr(kind, method, None))]
    if missing:
        raise ModelError(f"collision_detector '{name}' has no method {', '.join(missing)}; {allowed}")
    return kind


def checker_name(new_checker: CollisionCheckerFactory) -> str:
    """Returns the class of a collision checker as `module/Class`."""
    kind: Any = new_checker
    return f"{kind.__module__}/{kind.__qualname__}"
