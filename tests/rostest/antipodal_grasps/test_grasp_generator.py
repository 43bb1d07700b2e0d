# SPDX-License-Identifier: BSD-3-Clause
"""The method does what every grasp generator does."""

from __future__ import annotations

from modular_framework_testing.grasping.generator_conformance import GraspGeneratorConformance


class TestAntipodalGrasps(GraspGeneratorConformance):
    """Grasps between opposite sides of an object."""

    package, node, manner = "antipodal_grasps", "antipodal_grasp_generator", "between two opposite sides"
