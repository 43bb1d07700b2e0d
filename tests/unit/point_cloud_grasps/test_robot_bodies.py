# SPDX-License-Identifier: BSD-3-Clause
"""Points on the robot are told from others by the shapes of its links where the links are."""

from __future__ import annotations

import numpy as np

from point_cloud_grasps.robot_bodies import RobotBodies

URDF = """<robot name="r"><link name="base"/>
<link name="arm"><collision><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.1 1.0"/></geometry></collision></link>
<link name="ball"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="odd"><collision><geometry><mesh filename="package://no_such_package/a.stl"/></geometry></collision></link>
</robot>"""


def test_points_in_a_link_or_nearer_than_the_padding_are_hidden() -> None:
    robot = RobotBodies(URDF)
    assert robot.links == ("arm", "ball")
    lying = np.array([[0.0, 0.0, 1.0, 2.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.3], [0.0, 0.0, 0.0, 1.0]])
    points = np.array([[2.5, 0.0, 0.3], [2.5, 0.0, 0.36], [2.5, 0.0, 0.38], [1.99, 0.0, 0.3], [1.97, 0.0, 0.3]])
    hidden = robot.hide(points, {"arm": lying}, padding=0.02)
    assert hidden.tolist() == [True, True, False, True, False]
    assert robot.hide(points, {"arm": lying}, padding=0.0).tolist() == [True, False, False, False, False]
    at = np.eye(4)
    at[:3, 3] = 2.5, 0.0, 0.47
    assert robot.hide(points, {"ball": at}, padding=0.0).tolist() == [False, False, True, False, False]


def test_links_whose_pose_is_not_known_hide_nothing() -> None:
    assert not RobotBodies(URDF).hide(np.zeros((3, 3)), {}, padding=0.1).any()


def test_a_shape_that_cannot_be_used_is_named() -> None:
    (fault,) = RobotBodies(URDF).faults
    assert "link 'odd'" in fault and "no_such_package" in fault
    (fault,) = RobotBodies("<robot").faults
    assert fault
    assert RobotBodies("").links == ()
