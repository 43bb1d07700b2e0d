# SPDX-License-Identifier: BSD-3-Clause
"""Fixture: a grasp request for a box."""

from __future__ import annotations

import numpy as np
import pytest

from mbf_method import GraspRequest, Gripper, RobotState, SceneObject


@pytest.fixture
def box_request() -> GraspRequest:
    """Request for a box of 0.04 x 0.07 x 0.1 m on a support at z = 0; the points are the corners of the box."""
    corners = np.array([[x, y, z] for x in (-0.02, 0.02) for y in (-0.035, 0.035) for z in (0.0, 0.1)])
    none = np.zeros((0, 3))
    box = SceneObject("box", corners, corners / np.linalg.norm(corners, axis=1)[:, None], none, none.astype(np.int64))
    gripper = Gripper(max_opening=0.1, pad_width=0.02, pad_height=0.03, fingertip=0.02)
    return GraspRequest("world", box, (), 0.0, gripper, RobotState(("j1",), np.array([0.5])), 1)
