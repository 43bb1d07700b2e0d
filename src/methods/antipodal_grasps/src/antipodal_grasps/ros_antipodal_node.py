# SPDX-License-Identifier: BSD-3-Clause
"""The node of the method: its parameters, and its grasps in the form that all grasp generators share."""

from __future__ import annotations

import math

import numpy as np

from antipodal_grasps.antipodal import AntipodalGrasp, AntipodalSettings, antipodal_grasps
from antipodal_grasps.contact_pairs import PairSettings
from antipodal_grasps.hand_poses import HandSettings
from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate, GraspQuery
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry
from modular_framework_core.grasp_generation.ros_generator_settings import number
from modular_framework_core.grasp_generation.ros_grasp_generator import run_grasp_generator

HALF_TURN = np.diag([-1.0, -1.0, 1.0])
FAR_TRAVEL, TRAVEL_SHARE = 1.5, 0.2
"""A joint that moves this far [rad] between two poses of a grasp has swung to another posture of the arm."""


class AntipodalMethod:
    """Antipodal grasps; the parameters of :func:`read_antipodal_settings` are read again for every object."""

    manner = "between two opposite sides"

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps of an object in the order of :func:`antipodal_grasps`, then with the hand half turned."""
        settings = read_antipodal_settings()
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
        settings.approach_distance_m,
        settings.lift_distance_m,
        grasp.quality,
    )


def read_antipodal_settings() -> AntipodalSettings:
    """Reads the parameters of the method; a value out of range is replaced by its default, and that is logged."""
    pairs, hand, defaults = PairSettings(), HandSettings(), AntipodalSettings()
    pairs = PairSettings(
        surface_samples=int(number("~surface_samples", pairs.surface_samples, 10, 100000)),
        lines_per_sample=int(number("~lines_per_sample", pairs.lines_per_sample, 1, 100)),
        friction=number("~friction", pairs.friction, 0.02, 2.0),
    )
    hand = HandSettings(
        approach_step_rad=number("~approach_step", hand.approach_step_rad, 0.05, math.pi),
        max_approach_angle_rad=number("~max_approach_angle", hand.max_approach_angle_rad, 0.01, math.pi),
        finger_clearance_m=number("~finger_clearance", hand.finger_clearance_m, 0.0, 0.1),
        min_finger_clearance_m=number("~min_finger_clearance", hand.min_finger_clearance_m, 0.0, 0.1),
        tip_clearance_m=number("~tip_clearance", hand.tip_clearance_m, 0.0, 0.1),
        min_pad_overlap_m=number("~min_pad_overlap", hand.min_pad_overlap_m, 0.001, 0.1),
        cone_cosine=pairs.cone_cosine,
    )
    return AntipodalSettings(
        pairs=pairs,
        hand=hand,
        approach_distance_m=number("~approach_distance", defaults.approach_distance_m, 0.01, 0.5),
        lift_distance_m=number("~lift_distance", defaults.lift_distance_m, 0.0, 1.0),
        full_clearance_m=number("~full_clearance", defaults.full_clearance_m, 0.001, 1.0),
        max_poses=int(number("~max_poses", defaults.max_poses, 1, 1000000)),
        max_candidates=int(number("~max_candidates", defaults.max_candidates, 1, 1000000)),
    )


def main() -> int:
    """Runs the node ``antipodal_grasp_generator``; returns 1 when something it needs is missing."""
    return run_grasp_generator("antipodal_grasp_generator", AntipodalMethod())
