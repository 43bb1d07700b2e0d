# SPDX-License-Identifier: BSD-3-Clause
"""What stands on a table is found without knowing of it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from depth_camera import Box, Cylinder, Sphere, seen  # noqa: E402

from modular_framework_core.grasp_generation.grasp_candidates import NoCandidatesError  # noqa: E402
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox  # noqa: E402
from point_cloud_grasps.cloud_grasps import CloudSettings  # noqa: E402
from point_cloud_grasps.seen_objects import seen_objects  # noqa: E402

CROP = CropBox((-0.345, 0.2, 0.84), (0.355, 0.9, 1.35))
TABLE_M = 0.84
TABLE = Box((1.5, 1.0, 0.02), (0.0, 0.5, TABLE_M - 0.01))
THINGS = {
    "box": Box((0.05, 0.07, 0.10), (0.1, 0.5, TABLE_M + 0.05)),
    "can": Cylinder(0.033, 0.115, (-0.1, 0.45, TABLE_M + 0.0575)),
    "ball": Sphere(0.034, (0.2, 0.7, TABLE_M + 0.034)),
    "far": Box((0.1, 0.1, 0.1), (0.5, 0.5, TABLE_M + 0.05)),
}


def test_each_thing_in_the_crop_box_is_an_object_that_reaches_down_to_the_table() -> None:
    found = seen_objects(seen([TABLE, *THINGS.values()], 0.001), CROP, CloudSettings(), seed=1)
    assert [each.name for each in found] == ["seen_1", "seen_2", "seen_3"]
    for name in ("box", "can", "ball"):
        thing = THINGS[name]
        (near,) = [each for each in found if np.linalg.norm((each.centre - thing.centre)[:2]) < 0.01]
        assert near.bottom == pytest.approx(TABLE_M, abs=0.002)
        height = thing.size[2] if isinstance(thing, Box) else getattr(thing, "height", 0.068)
        assert near.surface.points[:, 2].max() == pytest.approx(TABLE_M + height, abs=0.005)


def test_an_empty_table_and_no_table_are_told_apart() -> None:
    with pytest.raises(
        NoCandidatesError, match="no cluster of at least 20 points and 6 mm height is on the plane at 0.840 m"
    ):
        seen_objects(seen([TABLE]), CROP, CloudSettings(), seed=1)
    with pytest.raises(NoCandidatesError, match="no level plane in the crop box"):
        seen_objects(np.zeros((0, 3)), CROP, CloudSettings(), seed=1)
