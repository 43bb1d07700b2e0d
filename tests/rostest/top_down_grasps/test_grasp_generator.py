# SPDX-License-Identifier: BSD-3-Clause
"""The method does what every grasp generator does, and grasps the box straight from above, across its narrow side."""

from __future__ import annotations

import pytest

from modular_framework_testing.grasping.generator_conformance import (
    BOX_SIZE,
    BOX_Z,
    GraspGeneratorConformance,
    next_grasp,
)


class TestTopDownGrasps(GraspGeneratorConformance):
    """Grasps from above."""

    package, node, manner = "top_down_grasps", "top_down_grasp_generator", "from above"

    def test_the_best_grasp_of_a_box_is_over_its_centre_and_open_a_little_wider(self) -> None:
        self.scene.objects = self.scene.objects[:1]
        self.scene.add_box("box__link", BOX_SIZE, (0.05, 0.5, BOX_Z))
        assert self.generate()[0]
        best = next_grasp().grasp_message
        place = best.grasp.pose.pose.position
        assert (place.x, place.y) == pytest.approx((0.05, 0.5), abs=1e-6)
        opening = 0.12 - 0.01 - 2 * best.pregrasp.posture.position[0]
        assert opening == pytest.approx(0.04 + 2 * 0.012, abs=1e-3)
