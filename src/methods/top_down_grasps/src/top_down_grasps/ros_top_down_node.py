# SPDX-License-Identifier: BSD-3-Clause
"""The ROS node of the method: its parameters, and its grasps as candidates."""

from __future__ import annotations

import math
from dataclasses import asdict

import numpy as np

from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate, GraspQuery, ReadNumber
from modular_framework_core.grasp_generation.ros_generator_settings import ParameterisedMethod, read_hand_motion
from modular_framework_core.grasp_generation.ros_grasp_generator import run_grasp_generator
from top_down_grasps.top_down import TopDownGrasp, TopDownSettings, top_down_grasps


class TopDownMethod(ParameterisedMethod):
    """Top-down grasps; the parameters of :func:`read_top_down_settings` are read again for every object."""

    manner = "from above"
    declared_in = ("top_down_grasps", "top_down_grasp_generator")

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps of an object, best first."""
        settings = read_top_down_settings(self.read)
        return [
            _candidate(grasp, settings)
            for grasp in top_down_grasps(query.target.surface, query.support_z, query.gripper, settings)
        ]

    def reached_quality(self, candidate: GraspCandidate, joint_travel: float) -> float:
        """Returns the grasp quality, independent of the joint travel."""
        return candidate.quality


def _candidate(grasp: TopDownGrasp, settings: TopDownSettings) -> GraspCandidate:
    cosine, sine = math.cos(grasp.yaw), math.sin(grasp.yaw)
    return GraspCandidate(
        np.array(grasp.position),
        np.array([[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]]),
        grasp.pregrasp_joint,
        settings.approach_distance_m,
        settings.lift_distance_m,
        grasp.quality,
    )


def read_top_down_settings(read: ReadNumber) -> TopDownSettings:
    """Reads the parameters of the method.

    Args:
        read: Function that reads a parameter.
    """
    return TopDownSettings(
        **asdict(read_hand_motion(read)),
        min_side_alignment=read("~min_side_alignment"),
        yaw_step_rad=read("~yaw_step"),
        position_step_m=read("~place_step"),
        best_reach_m=read("~best_reach"),
        base_xy_m=(read("~base_x"), read("~base_y")),
    )


def main() -> int:
    """Runs the node ``top_down_grasp_generator``; returns 1 if a requirement is missing."""
    return run_grasp_generator("top_down_grasp_generator", TopDownMethod())
