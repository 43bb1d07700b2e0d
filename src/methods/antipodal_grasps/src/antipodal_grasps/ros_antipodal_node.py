# SPDX-License-Identifier: BSD-3-Clause
"""The ROS node of the method: its parameters, and its grasps as candidates."""

from __future__ import annotations

from antipodal_grasps.antipodal import AntipodalSettings, antipodal_grasps
from antipodal_grasps.contact_pairs import PairSettings
from modular_framework_core.grasp_generation.grasp_candidates import GraspCandidate, GraspQuery, ReadNumber
from modular_framework_core.grasp_generation.pair_grasps import candidates_of, quality_with_travel
from modular_framework_core.grasp_generation.ros_generator_settings import (
    ParameterisedMethod,
    read_pair_grasps,
)
from modular_framework_core.grasp_generation.ros_grasp_generator import run_grasp_generator


class AntipodalMethod(ParameterisedMethod):
    """Antipodal grasps; the parameters of :func:`read_antipodal_settings` are read again for every object."""

    manner = "between two opposite sides"
    declared_in = ("antipodal_grasps", "antipodal_grasp_generator")

    def candidates(self, query: GraspQuery) -> list[GraspCandidate]:
        """Returns the grasps in the order of :func:`antipodal_grasps`, then the same with the hand rotated by pi."""
        settings = read_antipodal_settings(self.read)
        return candidates_of(antipodal_grasps(query, settings), query.gripper, settings)

    def reached_quality(self, candidate: GraspCandidate, joint_travel: float) -> float:
        """Returns the grasp quality combined with the joint travel between the poses of the grasp."""
        return quality_with_travel(candidate.quality, joint_travel)


def read_antipodal_settings(read: ReadNumber) -> AntipodalSettings:
    """Reads the parameters of the method.

    Args:
        read: Function that reads a parameter.
    """
    pairs = PairSettings(
        surface_samples=int(read("~surface_samples")),
        lines_per_sample=int(read("~lines_per_sample")),
        friction=read("~friction"),
    )
    shared = read_pair_grasps(pairs.cone_cosine, read)
    return AntipodalSettings(shared.hand, shared.full_clearance_m, shared.max_poses, shared.max_candidates, pairs=pairs)


def main() -> int:
    """Runs the node ``antipodal_grasp_generator``; returns 1 if a requirement is missing."""
    return run_grasp_generator("antipodal_grasp_generator", AntipodalMethod())
