# SPDX-License-Identifier: BSD-3-Clause
"""Bodies at rest outside of PyBullet, whose step costs about 1 us for every body, even for a static or sleeping body.

A stored body is removed from the engine and loaded again later, with the same pose, joint positions and properties. The
engine gives a reloaded body a new id, so all other modules use ids that do not change.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_engine import LinkMotion

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

    def joined(self, others: Boxes) -> Boxes:
        """Returns these boxes and other boxes."""
        return Boxes(np.concatenate((self.lower, others.lower)), np.concatenate((self.upper, others.upper)))

    @property
    def hull(self) -> tuple[Array, Array]:
        """Returns the corners of the smallest box around all boxes."""
        return self.lower.min(axis=0), self.upper.max(axis=0)

    def grown(self, margins: Array | float) -> Boxes:
        """Returns the boxes with margins on all sides [m]."""
        margin = np.broadcast_to(np.asarray(margins, dtype=float), len(self.lower))[:, None]
        return Boxes(self.lower - margin, self.upper + margin)

    def overlapped_by(self, others: Boxes) -> npt.NDArray[np.bool_]:
        """Returns for each box whether another box overlaps it."""
        found = np.zeros(len(self.lower), dtype=bool)
        if len(others.lower):
            low, high = others.hull
            hull = (self.lower <= high) & (self.upper >= low)
            near = np.flatnonzero(np.all(hull, axis=1))
            lower, upper = self.lower[near, None], self.upper[near, None]
            overlaps = np.all((lower <= others.upper) & (upper >= others.lower), axis=2)
            found[near] = np.any(overlaps, axis=1)
        return found

    def reached_from(self, seeds: Boxes, movable: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Returns for each box whether a motion of the seeds can reach it, directly or through movable boxes.

        Args:
            seeds: Boxes of moving bodies.
            movable: Whether each box moves if it is pushed, shape (boxes,); a static body passes no motion on.
        """
        reached = front = self.overlapped_by(seeds)
        while (pushed := front & movable).any():
            neighbours = self.overlapped_by(Boxes(self.lower[pushed], self.upper[pushed]).grown(_GAP_M))
            front = neighbours & ~reached
            reached = reached | front
        return reached


@dataclass(frozen=True, slots=True)
class Recipe:
    """Everything needed to load a body again.

    Attributes:
        text: URDF of the body.
        fixed: Whether the root link is fixed to the world.
        joints: Engine indices of the movable joints.
        options: Properties by link index, as options of the engine.
        motors: Settings of joint motors by joint index, as functions that apply the settings.
    """

    text: str
    fixed: bool
    joints: tuple[int, ...]
    options: dict[int, dict[str, Any]] = field(default_factory=dict)
    motors: dict[int, Callable[[], None]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class StoredMotion:
    """State of a stored body, which is at rest.

    Attributes:
        centre: Pose of the root link's centre of mass.
        links: Motions of the other links, by link index.
        joints: Positions of the movable joints by index [rad or m]; a quaternion xyzw for a ball joint.
    """

    centre: Pose
    links: tuple[LinkMotion, ...]
    joints: dict[int, tuple[float, ...]]


class BodyStore:
    """Numbers of the bodies in the engine, and the stored bodies.

    Args:
        api: Module pybullet.
        client: Id of the connection.
        load: Function that loads a body from URDF text, fixed to the world or not, and returns its id.
    """

    def __init__(self, api: Any, client: int, load: Callable[[str, bool], int]) -> None:
        self._api, self._client, self._load = api, client, load
        self._ids: dict[int, int] = {}
        self._numbers: dict[int, int] = {}
        self._recipes: dict[int, Recipe] = {}
        self._stored: dict[int, StoredMotion] = {}
        self._boxes = Boxes.of_corners(())
        self._movable = np.zeros(0, dtype=bool)

    @property
    def stored(self) -> dict[int, StoredMotion]:
        """Returns the states of the stored bodies, by number."""
        return self._stored

    def add(self, body: int) -> int:
        """Returns the number of a new body.

        Args:
            body: Id of the body in the engine.
        """
        number = body if body not in self._ids else max(self._ids) + 1
        self._ids[number], self._numbers[body] = body, number
        return number

    def keep_recipe(self, number: int, text: str, fixed: bool, joints: Sequence[int]) -> None:
        """Allows to store a body.

        Args:
            number: Number of the body.
            text: URDF of the body.
            fixed: Whether the root link is fixed to the world.
            joints: Engine indices of the movable joints.
        """
        self._recipes[number] = Recipe(text, fixed, tuple(joints))

    def can_store(self, number: int) -> bool:
        """Returns whether a body can be stored."""
        return number in self._recipes

    def note_options(self, number: int, index: int, options: dict[str, Any]) -> None:
        """Records properties of a link, which a loaded body gets again.

        Args:
            number: Number of the body.
            index: Index of the link in the engine.
            options: Options of the engine.
        """
        if number in self._recipes:
            self._recipes[number].options.setdefault(index, {}).update(options)

    def note_motor(self, number: int, index: int, setting: Callable[[], None]) -> None:
        """Records the setting of a joint motor, which a loaded body gets again.

        Args:
            number: Number of the body.
            index: Index of the joint in the engine.
            setting: Function that applies the setting.
        """
        if number in self._recipes:
            self._recipes[number].motors[index] = setting

    def remove(self, number: int) -> None:
        """Forgets a body of the engine."""
        self._numbers.pop(self._ids.pop(number), None)
        self._recipes.pop(number, None)

    def number(self, body: int) -> int:
        """Returns the number of a body of the engine."""
        return self._numbers.get(body, body)

    def body_id(self, number: int) -> int:
        """Returns the id of a body in the engine."""
        return self._ids[number]

    def store(self, numbers: list[int], boxes: Boxes, movable: npt.NDArray[np.bool_]) -> None:
        """Removes bodies at rest from the engine.

        Args:
            numbers: Numbers of the bodies.
            boxes: Their boxes.
            movable: Whether each body moves if it is pushed, shape (bodies,).
        """
        for number in numbers:
            body = self._ids[number]
            self._stored[number] = self._motion(number)
            self._api.removeBody(body, physicsClientId=self._client)
            self._ids[number] = -1
            del self._numbers[body]
        self._boxes = self._boxes.joined(boxes)
        self._movable = np.concatenate((self._movable, movable))

    def _motion(self, number: int) -> StoredMotion:
        api, client, body, joints = self._api, self._client, self._ids[number], self._recipes[number].joints
        links = range(api.getNumJoints(body, physicsClientId=client))
        states = api.getJointStatesMultiDof(body, joints, physicsClientId=client) if joints else ()
        return StoredMotion(
            Pose(*api.getBasePositionAndOrientation(body, physicsClientId=client)),
            tuple(link_motion(api.getLinkState(body, link, 1, 1, physicsClientId=client)) for link in links),
            {joint: tuple(state[0]) for joint, state in zip(joints, states, strict=True)},
        )

    def box(self, number: int) -> Boxes:
        """Returns the box of a stored body."""
        index = list(self._stored).index(number)
        return Boxes(self._boxes.lower[index : index + 1], self._boxes.upper[index : index + 1])

    def find(self, seeds: Boxes) -> list[int]:
        """Returns the stored bodies that a motion of the seeds can reach, directly or through other bodies."""
        reached = self._boxes.reached_from(seeds, self._movable)
        return list(itertools.compress(self._stored, reached)) if reached.any() else []

    def bring_back(self, numbers: Iterable[int]) -> None:
        """Loads stored bodies again; they move freely for one step before they sleep, which restores their contacts."""
        chosen = set(numbers)
        if not chosen:
            return
        kept = np.array([number not in chosen for number in self._stored], dtype=bool)
        self._boxes, self._movable = Boxes(self._boxes.lower[kept], self._boxes.upper[kept]), self._movable[kept]
        for number in sorted(chosen):
            motion, recipe = self._stored.pop(number), self._recipes[number]
            body = self._load(recipe.text, recipe.fixed)
            self._ids[number], self._numbers[body] = body, number
            for index, options in recipe.options.items():
                self._api.changeDynamics(body, index, **options, physicsClientId=self._client)
            self._api.resetBasePositionAndOrientation(
                body, motion.centre.position, motion.centre.quaternion, physicsClientId=self._client
            )
            for index, position in motion.joints.items():
                self._api.resetJointStateMultiDof(body, index, position, physicsClientId=self._client)
            for set_motor in recipe.motors.values():
                set_motor()


def link_motion(record: tuple[Any, ...]) -> LinkMotion:
    """Converts the engine's record of a link."""
    return LinkMotion(Pose(record[0], record[1]), Pose(record[4], record[5]), record[6], record[7])
