# SPDX-License-Identifier: BSD-3-Clause
"""What a grasp method is asked, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox, SceneObject

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GraspQuery:
    """An object to grasp, where it stands.

    Attributes:
        target: The object.
        obstacles: The other objects of the scene.
        support_z: Height of what the target stands on [m].
        gripper: Geometry of the hand.
        seed: Seed of every random choice.
    """

    target: SceneObject
    obstacles: tuple[SceneObject, ...]
    support_z: float
    gripper: GripperGeometry
    seed: int


@dataclass(frozen=True, slots=True)
class GraspCandidate:
    """One way to grasp an object: the hand advances along its approach, closes, and is lifted.

    Attributes:
        position: (3,) the grasp frame in the planning frame [m].
        hand_axes: (3, 3) axes of the hand in the planning frame, as columns: closing, across and approach.
        pregrasp_joint: Gripper joint position with which the hand advances [rad or m].
        approach_distance_m: How far behind the grasp the hand begins to advance [m].
        lift_distance_m: How high the hand is lifted [m].
        quality: Rank in [0, 1]; more is better.
    """

    position: Array
    hand_axes: Array
    pregrasp_joint: float
    approach_distance_m: float
    lift_distance_m: float
    quality: float

    @property
    def pregrasp_position(self) -> Array:
        """Where the grasp frame begins to advance, in the planning frame (3,) [m]."""
        return self.position - self.approach_distance_m * self.hand_axes[:, 2]

    @property
    def postgrasp_position(self) -> Array:
        """Where the grasp frame is lifted to, in the planning frame (3,) [m]."""
        return self.position + np.array([0.0, 0.0, self.lift_distance_m])


class NoCandidatesError(RuntimeError):
    """A method finds no grasp of an object; the text says why, to follow "no part of it can be grasped ...:"."""


class ReadNumber(Protocol):
    """Reads a parameter of a method, which is a number."""

    def __call__(self, name: str) -> float:
        """Returns its value, or the default that is declared for it.

        Args:
            name: Parameter, with ~ in front as of a node's own.

        Raises:
            Exception: It is not declared, or the value is not allowed; the kind depends on who reads.
        """


class GraspMethod(Protocol):
    """Finds and ranks grasps; what one grasp generator does differently from another."""

    @property
    def manner(self) -> str:
        """How it grasps, to complete "no part of this can be grasped ...": ``from above``."""

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps of an object, best first; empty when it cannot be grasped in this manner.

        Raises:
            NoCandidatesError: It cannot, and the method knows why.
        """

    def reached_quality(self, candidate: GraspCandidate, joint_travel: float) -> float:
        """Ranks a grasp that the arm can reach.

        Args:
            candidate: The grasp.
            joint_travel: Farthest that a joint moves from pregrasp to grasp, or from grasp to lift [rad or m].

        Returns:
            Its final rank in [0, 1]; more is better.
        """


@runtime_checkable
class SeeingMethod(Protocol):
    """What a grasp method offers besides that finds objects itself where the planning scene has none."""

    def connect(self) -> None:
        """Connects to what it sees with; called once, by a node."""

    def seen_objects(self, crop: CropBox, seed: int) -> list[SceneObject]:
        """Returns the objects in the crop box.

        Args:
            crop: Where objects are looked for.
            seed: Seed of every random choice.

        Raises:
            NoCandidatesError: There are none; the text says why.
        """
