# SPDX-License-Identifier: BSD-3-Clause
"""A scene that several clients change at once, and checks of motions in the scenes in force."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import rospy
from moveit_msgs.msg import CollisionObject, PlanningScene
from moveit_msgs.srv import ApplyPlanningScene

from modular_framework_testing.planning.independent_checker import IndependentChecker, Solid, box, pose_matrix


@dataclass(frozen=True)
class Change:
    """A change of a client's objects: times of request and response [s, monotonic], objects afterwards."""

    begun: float
    ended: float
    objects: Mapping[str, CollisionObject]


@dataclass
class World:
    """Changes of the scene, by client. Each client changes its own objects, in one thread."""

    histories: dict[str, list[Change]] = field(default_factory=dict)

    def change(self, owner: str, *messages: CollisionObject) -> None:
        """Applies objects (ADD or REMOVE) of one client, all at once."""
        history = self.histories.setdefault(owner, [])
        objects = dict(history[-1].objects) if history else {}
        for item in messages:
            if item.operation == CollisionObject.REMOVE:
                objects.pop(item.id)
            else:
                objects[item.id] = item
        scene = PlanningScene(is_diff=True)
        scene.world.collision_objects = list(messages)
        begun = time.monotonic()
        assert rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)(scene).success, "the scene was refused"
        history.append(Change(begun, time.monotonic(), objects))

    def objects_between(self, begun: float, ended: float) -> dict[str, CollisionObject]:
        """Returns all objects that may have been in the scene during a period, by name."""
        return {
            name: item
            for history in self.histories.values()
            for number, change in enumerate(history)
            if change.begun <= ended and _end(history, number) >= begun
            for name, item in change.objects.items()
        }

    def was_free_of(self, touched: set[str], begun: float, ended: float) -> bool:
        """Returns whether, at some moment of a period, the scene may have had none of the touched objects.

        While a client waits for a response, its objects may be the old or the new ones.

        Args:
            touched: Names of the touched objects.
            begun: Start of the period [s, monotonic].
            ended: End of the period [s, monotonic].
        """
        changes = [item for history in self.histories.values() for item in history]
        moments = {
            begun,
            ended,
            *(moment for item in changes for moment in (item.begun, item.ended) if begun <= moment <= ended),
        }
        return any(
            all(
                any(not item.keys() & touched for item in _in_force(history, moment))
                for history in self.histories.values()
            )
            for moment in moments
        )


def _end(history: Sequence[Change], number: int) -> float:
    return history[number + 1].ended if number + 1 < len(history) else np.inf


def _in_force(history: Sequence[Change], moment: float) -> list[Mapping[str, CollisionObject]]:
    """Returns the possible objects of a client at a moment."""
    found = [change.objects for number, change in enumerate(history) if change.begun <= moment <= _end(history, number)]
    return found + [{}] if moment <= history[0].ended else found


def gone(name: str) -> CollisionObject:
    """Returns the message that removes an object."""
    return CollisionObject(id=name, operation=CollisionObject.REMOVE)


def obstacle(message: CollisionObject) -> tuple[str, Solid, np.ndarray]:
    """Converts a box for the second checker."""
    size, place = message.primitives[0].dimensions, message.primitive_poses[0].position
    return message.id, box(*size), pose_matrix([place.x, place.y, place.z], np.eye(3))


def touched_bodies(
    checker: IndependentChecker,
    names: Sequence[str],
    path: np.ndarray,
    rest: Mapping[str, float],
    objects: Mapping[str, CollisionObject],
    *,
    step: float,
) -> set[str]:
    """Returns the names of the bodies that touch another body along a path.

    Args:
        checker: Second checker of the robot; gets the objects.
        names: Names of the joints in the columns of `path`.
        path: Vertices, shape (n, joints).
        rest: Positions of the other joints, by name.
        objects: Objects of the scene, by name.
        step: Maximum difference of a joint between samples [rad].
    """
    checker.set_world([obstacle(item) for item in objects.values()])
    touched: set[str] = set()
    for values in _samples(path, step):
        state = {**rest, **dict(zip(names, values.tolist(), strict=True))}
        for pair in checker.collisions(state, first_only=False):
            touched.update(objects.keys() & set(pair) or pair)
    return touched


def _samples(path: np.ndarray, step: float) -> np.ndarray:
    """Returns states on the straight pieces of a path; the joints differ by at most `step` between them."""
    lengths = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path, axis=0)).max(axis=1))])
    at = np.linspace(0.0, lengths[-1], 1 + int(np.ceil(lengths[-1] / step)))
    return np.column_stack([np.interp(at, lengths, column) for column in path.T])
