# SPDX-License-Identifier: BSD-3-Clause
"""Bodies at rest outside of PyBullet, whose step costs about 1 us for every body, even for a sleeping body.

A stored body is removed from the engine and loaded again later, at the same pose and with the same properties. The
engine gives a reloaded body a new id, so all other modules use ids that do not change.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.models.poses import Pose

Array = npt.NDArray[np.float64]

_GAP_M = 0.02
"""Distance up to which a body can push its neighbour as soon as it moves [m]."""


@dataclass(frozen=True, slots=True)
class Boxes:
    """Axis-aligned boxes in the world frame.

    Attributes:
        lower: Lower corners [m], shape (boxes, 3).
        upper: Upper corners [m], shape (boxes, 3).
    """

    lower: Array
    upper: Array

    @classmethod
    def of_corners(cls, corners: Iterable[tuple[Any, Any]]) -> Boxes:
        """Returns boxes from pairs of a lower and an upper corner."""
        array = np.array(list(corners), dtype=float).reshape(-1, 2, 3)
        return cls(array[:, 0], array[:, 1])

    def grown(self, margins: Array | float) -> Boxes:
        """Returns the boxes with margins on all sides [m]."""
        margin = np.broadcast_to(np.asarray(margins, dtype=float), len(self.lower))[:, None]
        return Boxes(self.lower - margin, self.upper + margin)

    def overlapped_by(self, others: Boxes) -> npt.NDArray[np.bool_]:
        """Returns for each box whether another box overlaps it."""
        found = np.zeros(len(self.lower), dtype=bool)
        if len(others.lower):
            hull = (self.lower <= others.upper.max(axis=0)) & (self.upper >= others.lower.min(axis=0))
            near = np.flatnonzero(np.all(hull, axis=1))
            lower, upper = self.lower[near, None], self.upper[near, None]
            overlaps = np.all((lower <= others.upper) & (upper >= others.lower), axis=2)
            found[near] = np.any(overlaps, axis=1)
        return found

    def reached_from(self, seeds: Boxes) -> npt.NDArray[np.bool_]:
        """Returns for each box whether a motion of the seeds can reach it, directly or through other boxes."""
        reached = front = self.overlapped_by(seeds)
        while front.any():
            neighbours = self.overlapped_by(Boxes(self.lower[front], self.upper[front]).grown(_GAP_M))
            front = neighbours & ~reached
            reached = reached | front
        return reached


class BodyStore:
    """Numbers of the bodies in the engine, and the stored bodies.

    Args:
        api: Module pybullet.
        client: Id of the connection.
        load: Function that loads a movable body from URDF text and returns its id.
    """

    def __init__(self, api: Any, client: int, load: Callable[[str], int]) -> None:
        self._api, self._client, self._load = api, client, load
        self._ids: dict[int, int] = {}
        self._numbers: dict[int, int] = {}
        self._texts: dict[int, str] = {}
        self._options: dict[int, dict[str, Any]] = {}
        self._stored: dict[int, Pose] = {}
        self._boxes = Boxes.of_corners(())

    @property
    def stored_poses(self) -> dict[int, Pose]:
        """Returns the poses of the centres of mass of the stored bodies, by number."""
        return self._stored

    def add(self, body: int) -> int:
        """Returns the number of a new body.

        Args:
            body: Id of the body in the engine.
        """
        number = body if body not in self._ids else max(self._ids) + 1
        self._ids[number], self._numbers[body] = body, number
        return number

    def keep_text(self, number: int, text: str) -> None:
        """Allows to store a body without joints.

        Args:
            number: Number of the body.
            text: URDF of the body.
        """
        self._texts[number], self._options[number] = text, {}

    def can_store(self, number: int) -> bool:
        """Returns whether a body can be stored."""
        return number in self._texts

    def note(self, number: int, options: dict[str, Any]) -> None:
        """Records properties of a root link, which a loaded body gets again."""
        if number in self._options:
            self._options[number] |= options

    def remove(self, number: int) -> None:
        """Forgets a body of the engine."""
        self._numbers.pop(self._ids.pop(number), None)
        self._texts.pop(number, None)
        self._options.pop(number, None)

    def number(self, body: int) -> int:
        """Returns the number of a body of the engine."""
        return self._numbers.get(body, body)

    def body_id(self, number: int) -> int:
        """Returns the id of a body in the engine."""
        return self._ids[number]

    def store(self, numbers: list[int], boxes: Boxes) -> None:
        """Removes sleeping bodies from the engine.

        Args:
            numbers: Numbers of the bodies.
            boxes: Their boxes.
        """
        for number in numbers:
            body = self._ids[number]
            pose = self._api.getBasePositionAndOrientation(body, physicsClientId=self._client)
            self._stored[number] = Pose(*pose)
            self._api.removeBody(body, physicsClientId=self._client)
            self._ids[number] = -1
            del self._numbers[body]
        self._boxes = Boxes(
            np.concatenate((self._boxes.lower, boxes.lower)), np.concatenate((self._boxes.upper, boxes.upper))
        )

    def find(self, seeds: Boxes) -> list[int]:
        """Returns the stored bodies that a motion of the seeds can reach, directly or through other bodies."""
        reached = self._boxes.reached_from(seeds)
        return list(itertools.compress(self._stored, reached)) if reached.any() else []

    def bring_back(self, numbers: Iterable[int]) -> None:
        """Loads stored bodies again; they move freely for one step before they sleep, which restores their contacts."""
        chosen = set(numbers)
        if not chosen:
            return
        kept = np.array([number not in chosen for number in self._stored], dtype=bool)
        self._boxes = Boxes(self._boxes.lower[kept], self._boxes.upper[kept])
        for number in sorted(chosen):
            pose = self._stored.pop(number)
            body = self._load(self._texts[number])
            self._ids[number], self._numbers[body] = body, number
            self._api.changeDynamics(body, -1, **self._options[number], physicsClientId=self._client)
            self._api.resetBasePositionAndOrientation(
                body, pose.position, pose.quaternion, physicsClientId=self._client
            )
