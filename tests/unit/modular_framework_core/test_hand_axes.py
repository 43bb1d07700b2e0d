# SPDX-License-Identifier: BSD-3-Clause
"""Approach and closing direction of a hand are found from where its fingers and its palm are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometryError, measure_gripper
from modular_framework_core.grasp_generation.hand_axes import hand_axes

AHEAD = np.array([0.0, -0.005, 0.06])
OPENING = np.array([0.08, 0.0, 0.0])


def test_a_hand_that_approaches_along_z_and_closes_along_x_has_the_axes_of_its_frame() -> None:
    assert hand_axes(AHEAD, OPENING) == pytest.approx(np.eye(3))
    assert hand_axes(AHEAD, -OPENING) == pytest.approx(np.eye(3))


@pytest.mark.parametrize("approach", [(0.0, 0.0), (np.pi / 2, 0.0), (np.pi, 0.0), (0.0, np.pi / 2), (0.0, -np.pi / 2)])
@pytest.mark.parametrize("yaw", [0.0, np.pi / 2, 0.7])
def test_the_axes_turn_with_the_frame(approach: tuple[float, float], yaw: float) -> None:
    # the frame may be turned about its approach by any angle, and otherwise by quarter turns
    frame = Rotation.from_euler("xy", approach).as_matrix() @ Rotation.from_euler("z", yaw).as_matrix()
    axes = hand_axes(frame @ AHEAD, frame @ OPENING)
    assert axes[:, 2] == pytest.approx(frame[:, 2], abs=1e-9)
    assert abs(axes[:, 0] @ frame[:, 0]) == pytest.approx(1.0)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_finger_that_leans_while_it_opens_has_no_influence_on_the_approach() -> None:
    assert hand_axes(AHEAD, OPENING + [0.0, 0.0, 0.03]) == pytest.approx(np.eye(3))


@pytest.mark.parametrize("opening", [0.0 * OPENING, np.array([0.0, 0.0, 0.05])], ids=["none", "along the approach"])
def test_fingers_that_do_not_close_are_refused(opening: np.ndarray) -> None:
    with pytest.raises(ValueError, match="do not move relative to each other perpendicular to the approach"):
        hand_axes(AHEAD, opening)


def slides(palm: str, finger: str) -> str:
    """A hand of two fingers along x, 40 mm ahead of a palm."""
    return f"""<robot name="r"><link name="palm">{palm}</link><link name="tip"/>
<joint name="mount" type="fixed"><parent link="palm"/><child link="tip"/><origin xyz="0 0 0.05"/></joint>
<link name="left">{FINGER}</link><link name="right">{finger}</link>
<joint name="f" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="1 0 0"/><origin xyz="-0.06 0 0"/>
  <limit lower="0" upper="0.055" effort="1" velocity="1"/></joint>
<joint name="g" type="prismatic"><parent link="palm"/><child link="right"/><axis xyz="-1 0 0"/><origin xyz="0.06 0 0"/>
  <limit lower="0" upper="0.055" effort="1" velocity="1"/><mimic joint="f"/></joint></robot>"""


FINGER = '<collision><origin xyz="0 0 0.04"/><geometry><box size="0.01 0.03 0.05"/></geometry></collision>'


@pytest.mark.parametrize("palm", ["", '<collision><geometry><sphere radius="0.01"/></geometry></collision>'])
def test_a_palm_may_have_no_shape(palm: str) -> None:
    gripper = measure_gripper(slides(palm, FINGER), "tip", "f")
    assert gripper.axes == pytest.approx(np.eye(3))
    assert gripper.max_opening == pytest.approx(0.11)


def test_a_finger_without_a_shape_is_named() -> None:
    with pytest.raises(GripperGeometryError, match=r"finger links \['left', 'right'\] .* have 1 collision shapes"):
        measure_gripper(slides("", ""), "tip", "f")
