# SPDX-License-Identifier: BSD-3-Clause
"""Reachability of a grasp: collision-free inverse kinematics at its three poses, as grasp generators request it."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from modular_framework_benchmark.modes.robots import Robot
from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.kinematics.inverse_kinematics import InverseKinematics
from modular_framework_planning.kinematics.solution_choice import first_free
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_scene.planning_scene import PlanningScene


class GraspReach:
    """Solves inverse kinematics for grasps in a planning scene.

    Args:
        robot: Robot.
        solver: Inverse kinematics of the group whose tip is the grasp frame.
        gripper: Geometry of the hand.
        scene: Planning scene.
    """

    def __init__(self, robot: Robot, solver: InverseKinematics, gripper: GripperGeometry, scene: PlanningScene) -> None:
        self._model, self._solver, self._gripper, self._scene = robot.model, solver, gripper, scene
        self._checker = DEFAULT_CHECKER(scene, solver.group.indices)

    def joint_travel(self, candidate: GraspCandidate) -> float | None:
        """Returns the largest joint movement between successive poses of a grasp [rad or m], or None if unreachable.

        The hand advances with the opening of the grasp. The hand arrives at the first pose with its opening in the
        scene.

        Args:
            candidate: Grasp in the planning frame.
        """
        opened = self._model.merge(self._scene.positions, {self._gripper.joint: candidate.pregrasp_joint})
        opened = self._model.with_mimics(opened)
        checker = DEFAULT_CHECKER(self._scene.with_positions(opened), self._solver.group.indices)
        rotation = candidate.hand_axes @ self._gripper.axes.T
        seed, travel, indices = opened, 0.0, self._solver.group.indices
        for number, position in enumerate(
            (candidate.pregrasp_position, candidate.position, candidate.postgrasp_position)
        ):
            try:
                solutions = self._solver.solutions(
                    self._solver.group.tip_link, pin.SE3(rotation, np.asarray(position)), seed, timeout_s=math.inf
                )
            except PlanningError:
                return None
            free = first_free(solutions, checker.is_free)
            if not free or (number == 0 and not self._checker.is_free(self._positions_in_scene(free[0]))):
                return None
            if number:
                travel = max(travel, float(np.max(np.abs(free[0][indices] - seed[indices]))))
            seed = free[0]
        return travel

    def _positions_in_scene(self, positions: Array) -> Array:
        """Returns positions in which the joints outside the group have the values of the scene."""
        result = self._scene.positions.copy()
        result[self._solver.group.indices] = positions[self._solver.group.indices]
        return self._model.with_mimics(result)
