# SPDX-License-Identifier: BSD-3-Clause
"""A generator query becomes a request to a method, and the returned grasps become candidates."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from external_grasps.grasp_conversions import grasp_candidates, grasp_request
from mbf_method import Grasps, RobotState
from modular_framework_core.grasp_generation import solid_meshes, surface_points
from modular_framework_core.grasp_generation.grasp_candidates import GraspQuery
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometry, measure_gripper
from modular_framework_core.grasp_generation.hand_motion_settings import HandMotionSettings
from modular_framework_core.grasp_generation.planning_scene_objects import SceneObject

sys.path.insert(0, str(Path(__file__).parents[1]))
from two_finger_hands import fixed_jaw, jaws  # noqa: E402

PAD_CENTRE_TO_TOOL_M = 0.115 - 0.095
"""Distance of the tool frame in front of the centre of the pads, from the hand's file."""


@pytest.fixture(scope="module")
def gripper() -> GripperGeometry:
    return measure_gripper(jaws(), "tool", "slide")


def test_a_request_has_the_objects_and_the_size_of_the_hand(gripper: GripperGeometry) -> None:
    sides = (0.04, 0.07, 0.1)
    box = SceneObject("box", surface_points.box(sides), (solid_meshes.box(sides),))
    seen = SceneObject("seen", surface_points.sphere(0.03))
    robot = RobotState(("j1",), np.array([0.5]))
    request = grasp_request(GraspQuery(box, (seen,), -0.05, gripper, 7), "world", robot)
    assert (request.frame, request.support_z, request.seed, request.robot) == ("world", -0.05, 7, robot)
    assert np.ptp(request.target.points, axis=0) == pytest.approx(sides)
    assert np.ptp(request.target.vertices, axis=0) == pytest.approx(sides)
    assert request.target.triangles.shape == (12, 3)
    assert (request.obstacles[0].name, request.obstacles[0].triangles.shape) == ("seen", (0, 3))
    assert request.gripper.max_opening == pytest.approx(0.1)
    assert request.gripper.pad_width == pytest.approx(0.02)
    assert request.gripper.pad_height == pytest.approx(0.07)
    assert request.gripper.fingertip == pytest.approx(0.07 / 2)


def test_the_pads_close_at_the_origin_of_a_pose_and_better_grasps_come_first(gripper: GripperGeometry) -> None:
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    poses = np.array([np.eye(4), down])
    poses[1, :3, 3] = 0.1, 0.2, 0.3
    grasps = Grasps("world", poses, np.array([0.2, 0.9]), np.array([0.02, 0.04]))
    best, other = grasp_candidates(grasps, gripper, HandMotionSettings())
    assert (best.quality, other.quality) == (0.9, 0.2)
    assert best.position == pytest.approx([0.1, 0.2, 0.3 - PAD_CENTRE_TO_TOOL_M])
    assert best.hand_axes == pytest.approx(down[:3, :3])
    assert 2 * best.pregrasp_joint == pytest.approx(0.04 + 2 * 0.012, abs=1e-3)
    assert other.position == pytest.approx([0.0, 0.0, PAD_CENTRE_TO_TOOL_M])


def test_a_grasp_without_clearance_for_the_fingers_is_omitted(gripper: GripperGeometry) -> None:
    widths = np.array([0.0939, 0.0941])
    grasps = Grasps("world", np.tile(np.eye(4), (2, 1, 1)), np.array([0.2, 0.9]), widths)
    assert [found.quality for found in grasp_candidates(grasps, gripper, HandMotionSettings())] == [0.2]


def test_an_object_is_in_the_middle_of_a_jaw_that_moves_and_one_that_is_fixed() -> None:
    gripper = measure_gripper(fixed_jaw(), "tool", "slide")
    grasps = Grasps("world", np.eye(4)[None], np.array([0.2]), np.array([0.02]))
    (found,) = grasp_candidates(grasps, gripper, HandMotionSettings())
    opening = 0.02 + 2 * 0.012
    assert found.pregrasp_joint == pytest.approx(opening, abs=1e-6)
    assert found.position == pytest.approx([-opening / 2, 0.0, PAD_CENTRE_TO_TOOL_M])
