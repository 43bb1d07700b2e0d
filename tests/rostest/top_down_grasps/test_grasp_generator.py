# SPDX-License-Identifier: BSD-3-Clause
"""The method does what every grasp generator does, and grasps the box straight from above, across its narrow side."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
pytest.register_assert_rewrite("grasp_generator_suite")
from grasp_generator_suite import *  # noqa: E402, F403
from grasp_generator_suite import BOX_SIZE, Method, get_grasp  # noqa: E402


@pytest.fixture(scope="module")
def method() -> Method:
    return Method("top_down_grasps", "top_down_grasp_generator", "from above")


def test_the_best_grasp_of_a_box_is_over_its_centre_and_open_a_little_wider(scene, method: Method) -> None:
    scene.objects = scene.objects[:1]
    scene.add_box("box__link", BOX_SIZE, (0.05, 0.5, 0.89))
    method.set("name_prefix", "")
    assert method.generate()[0]
    best = get_grasp().grasp_message
    place = best.grasp.pose.pose.position
    assert (place.x, place.y) == pytest.approx((0.05, 0.5), abs=1e-6)
    opening = 0.12 - 0.01 - 2 * best.pregrasp.posture.position[0]
    assert opening == pytest.approx(0.04 + 2 * 0.012, abs=1e-3)
