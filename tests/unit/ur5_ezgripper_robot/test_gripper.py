# SPDX-License-Identifier: BSD-3-Clause
"""The gripper of the description opens, closes and lies as its documentation says."""

import math

import numpy as np
import pinocchio
import pytest

ANGLES = np.linspace(0.0, 1.94, 12)
PAD_IN_PHALANX = np.array([0.030, 0.0, -0.011])
TIP_IN_PHALANX = np.array([0.0574, 0.0, -0.011])


def in_grasp_frame(model: pinocchio.Model, angle: float, finger: int, point: np.ndarray) -> np.ndarray:
    data = model.createData()
    pinocchio.forwardKinematics(model, data, np.array([0, 0, 0, 0, 0, 0, angle]))
    pinocchio.updateFramePlacements(model, data)
    grasp = data.oMf[model.getFrameId("eg_manipulator")]
    return np.asarray(grasp.actInv(data.oMf[model.getFrameId(f"ezgripper_finger_L2_{finger}")].act(point)))


def opening(model: pinocchio.Model, angle: float) -> float:
    first, second = (in_grasp_frame(model, angle, finger, PAD_IN_PHALANX) for finger in (1, 2))
    return float(second[0] - first[0])


@pytest.mark.parametrize("angle", ANGLES)
def test_the_opening_follows_the_documented_formula(model: pinocchio.Model, angle: float) -> None:
    assert opening(model, angle) == pytest.approx(2 * (0.019 + 0.052 * math.cos(angle)), abs=1e-6)


def test_the_gripper_opens_wider_than_twelve_centimetres_and_closes_without_overlap(model: pinocchio.Model) -> None:
    assert opening(model, 0.0) > 0.12
    assert 0.0 <= opening(model, 1.94) < 0.002


@pytest.mark.parametrize("angle", ANGLES)
def test_pads_stay_parallel_in_free_motion(model: pinocchio.Model, angle: float) -> None:
    for finger in (1, 2):
        along = in_grasp_frame(model, angle, finger, TIP_IN_PHALANX) - in_grasp_frame(
            model, angle, finger, np.array([0.0, 0.0, -0.011])
        )
        assert np.allclose(along, [0, 0, 0.0574], atol=1e-6)


@pytest.mark.parametrize("angle", ANGLES)
def test_fingers_close_symmetrically_along_x_of_the_grasp_frame(model: pinocchio.Model, angle: float) -> None:
    first, second = (in_grasp_frame(model, angle, finger, PAD_IN_PHALANX) for finger in (1, 2))
    assert np.allclose(first * [-1, 1, 1], second, atol=1e-9)
    assert first[1] == pytest.approx(0.0, abs=1e-9)
    assert first[0] < 0 < second[0]


@pytest.mark.parametrize("width", [0.02, 0.04, 0.06, 0.08])
def test_the_grasp_frame_lies_between_the_pads_while_holding(model: pinocchio.Model, width: float) -> None:
    angle = math.acos((width / 2 - 0.019) / 0.052)
    root, tip = (in_grasp_frame(model, angle, 1, np.array([x, 0, -0.011]))[2] for x in (0.0, 0.0574))
    assert root < -0.02
    assert 0.015 < tip < 0.025


def test_the_grasp_frame_has_the_orientation_of_tool0(model: pinocchio.Model) -> None:
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, np.array([0.3, -1, 1.2, 0.5, -0.7, 2, 1.0]))
    tool, grasp = (data.oMf[model.getFrameId(name)] for name in ("tool0", "eg_manipulator"))
    relative = tool.actInv(grasp)
    assert np.allclose(relative.rotation, np.eye(3), atol=1e-9)
    assert np.allclose(relative.translation, [0, 0, 0.1585], atol=1e-9)
