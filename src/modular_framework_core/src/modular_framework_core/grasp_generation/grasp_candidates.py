# SPDX-License-Identifier: BSD-3-Clause
"""Interface of grasp methods: query, grasp candidates, and the methods to implement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox, SceneObject
from modular_framework_ros.reported_figures import Figure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GraspQuery:
    """Object to grasp, with its surroundings.

    Attributes:
        target: Object to grasp.
        obstacles: All other objects of the scene.
        support_z: Height of the surface that supports the target [m].
        gripper: Geometry of the hand.
        seed: Seed of all random numbers.
    """

    target: SceneObject
    obstacles: tuple[SceneObject, ...]
    support_z: float
    gripper: GripperGeometry
    seed: int


@dataclass(frozen=True, slots=True)
class GraspCandidate:
    """Grasp of an object: the hand moves along its approach direction, closes, and lifts.

    Attributes:
        position: Position of the grasp frame in the planning frame, shape (3,) [m].
        hand_axes: Axes of the hand in the planning frame, as columns: closing, across, approach; shape (3, 3).
        pregrasp_joint: Gripper joint position during the approach [rad or m].
        approach_distance_m: Length of the approach [m].
        lift_distance_m: Height of the lift [m].
        quality: Quality in [0, 1]; higher is better.
    """

    position: Array
    hand_axes: Array
    pregrasp_joint: float
    approach_distance_m: float
    lift_distance_m: float
    quality: float

    @property
    def pregrasp_position(self) -> Array:
        """Position of the grasp frame before the approach, in the planning frame, shape (3,) [m]."""
        return self.position - self.approach_distance_m * self.hand_axes[:, 2]

    @property
    def postgrasp_position(self) -> Array:
        """Position of the grasp frame after the lift, in the planning frame, shape (3,) [m]."""
        return self.position + np.array([0.0, 0.0, self.lift_distance_m])


class NoCandidatesError(RuntimeError):
    """A method finds no grasp; the message is the cause, which follows "no part ... can be grasped ...: "."""


class MethodFaultError(NoCandidatesError):
    """The method failed; the generation ends for all objects. The message states the cause."""


class ReadNumber(Protocol):
    """Function that reads a numeric parameter of a method."""

    def __call__(self, name: str) -> float:
        """Returns the value of the parameter, or its declared default.

        Args:
            name: Parameter name; private parameters begin with `~`.

        Raises:
            Exception: The parameter is not declared or its value is invalid; the reader defines the exception type.
        """


class GraspMethod(Protocol):
    """Algorithm that finds and ranks grasps; the only part that differs between grasp generators."""

    @property
    def manner(self) -> str:
        """Adverbial phrase such as ``from above`` that completes the message "no part of ... can be grasped"."""

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps of an object, best first; empty if the method finds no grasp.

        Raises:
            NoCandidatesError: The method finds no grasp and knows the cause.
        """

    def reached_quality(self, candidate: GraspCandidate, joint_travel: float) -> float:
        """Returns the final quality of a reachable grasp in [0, 1]; higher is better.

        Args:
            candidate: Reachable grasp.
            joint_travel: Largest motion of a joint between two consecutive poses of the grasp [rad or m].
        """


@runtime_checkable
class ConnectedMethod(Protocol):
    """Additional interface of a grasp method that uses sensors or other processes."""

    def connect(self) -> None:
        """Connects to the sensors or processes; the node calls this method once."""


@runtime_checkable
class ProcessMethod(Protocol):
    """Additional interface of a grasp method with a process of its own."""

    @property
    def sources(self) -> str:
        """Digest of the sources that the process has imported; "" before the start, or if unknown."""

    def start(self) -> None:
        """Starts the process in advance, no effect while it runs; a fault is logged and raised by `candidates`."""

    def close(self) -> None:
        """Ends the process; may be called twice."""


@runtime_checkable
class MeasuredMethod(Protocol):
    """Additional interface of a grasp method that measures figures of its own."""

    def take_figures(self) -> dict[Figure, float]:
        """Returns the figures of all objects since the previous call."""


@runtime_checkable
class SeeingMethod(ConnectedMethod, Protocol):
    """Additional interface of a grasp method that detects objects if the planning scene contains no objects."""

    def seen_objects(self, crop: CropBox, seed: int) -> list[SceneObject]:
        """Returns the detected objects.

        Args:
            crop: Search volume.
            seed: Seed of all random numbers.

        Raises:
            NoCandidatesError: No object is detected; the message gives the cause.
        """
