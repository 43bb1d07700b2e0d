# SPDX-License-Identifier: BSD-3-Clause
"""The node of the method: its parameters, and its grasps in the form that all grasp generators share."""

from __future__ import annotations

import math
from dataclasses import asdict

import numpy as np

from antipodal_grasps.antipodal import AntipodalGrasp, AntipodalSettings, antipodal_grasps
from antipodal_grasps.contact_pairs import PairSettings
from antipodal_grasps.hand_poses import HandSettings
from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate, GraspQuery, ReadNumber
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.ros_generator_settings import ParameterisedMethod, number, read_hand_motion
from modular_framework_core.grasp_generation.ros_grasp_generator import run_grasp_generator

HALF_TURN = np.diag([-1.0, -1.0, 1.0])
FAR_TRAVEL, TRAVEL_SHARE = 1.5, 0.2
"""A joint that moves this far [rad] between two poses of a grasp has swung to another posture of the arm."""


class AntipodalMethod(ParameterisedMethod):
    """Antipodal grasps; the parameters of :func:`read_antipodal_settings` are read again for every object."""

    manner = "between two opposite sides"

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps of an object in the order of :func:`antipodal_grasps`, then with the hand half turned."""
        settings = read_antipodal_settings(self.read)
        grasps = antipodal_grasps(query, settings)
        return [_candidate(grasp, turn, query.gripper, settings) for turn in (np.eye(3), HALF_TURN) for grasp in grasps]

    def reached_quality(self, candidate: GraspCandidate, joint_travel: float) -> float:
        """Ranks by the quality of the hold, and by how little the arm moves between the poses of the grasp."""
        return (1.0 - TRAVEL_SHARE) * candidate.quality + TRAVEL_SHARE * (1.0 - min(1.0, joint_travel / FAR_TRAVEL))


def _candidate(
    grasp: AntipodalGrasp, turn: np.ndarray, gripper: GripperGeometry, settings: AntipodalSettings
) -> GraspCandidate:
    return GraspCandidate(
        grasp.pose.position,
        grasp.pose.axes @ turn,
        gripper.position_for(grasp.pose.opening),
        settings.hand.approach_distance_m,
        settings.hand.lift_distance_m,
        grasp.quality,
    )


def read_antipodal_settings(read: ReadNumber = number) -> AntipodalSettings:
    """Reads the parameters of the method.

    Args:
        read: Reads a parameter; by default from the parameter server, where a value out of range is replaced by its
            default, and that is logged.
    """
    pairs, hand, defaults = PairSettings(), HandSettings(), AntipodalSettings()
    pairs = PairSettings(
        surface_samples=int(read("~surface_samples", pairs.surface_samples, 10, 100000)),
        lines_per_sample=int(read("~lines_per_sample", pairs.lines_per_sample, 1, 100)),
        friction=read("~friction", pairs.friction, 0.02, 2.0),
    )
    hand = HandSettings(
        **asdict(read_hand_motion(read)),
        approach_step_rad=read("~approach_step", hand.approach_step_rad, 0.05, math.pi),
        max_approach_angle_rad=read("~max_approach_angle", hand.max_approach_angle_rad, 0.01, math.pi),
        cone_cosine=pairs.cone_cosine,
    )
    return AntipodalSettings(
        pairs=pairs,
        hand=hand,
        full_clearance_m=read("~full_clearance", defaults.full_clearance_m, 0.001, 1.0),
        max_poses=int(read("~max_poses", defaults.max_poses, 1, 1000000)),
        max_candidates=int(read("~max_candidates", defaults.max_candidates, 1, 1000000)),
    )


def main() -> int:
    """Runs the node ``antipodal_grasp_generator``; returns 1 when something it needs is missing."""
    return run_grasp_generator("antipodal_grasp_generator", AntipodalMethod())
