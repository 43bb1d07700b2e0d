# SPDX-License-Identifier: BSD-3-Clause
"""Jaws without <mimic> move together if they are mirror images of each other."""

from __future__ import annotations

import pytest

from modular_framework_urdf.mirrored_joints import mirror_multiplier
from modular_framework_urdf.robot import Joint
from modular_framework_urdf.urdf_reader import read_urdf

URDF = """<robot name="r"><link name="palm"/><link name="a"/><link name="b"/>
<joint name="left" type="prismatic"><parent link="palm"/><child link="a"/><axis xyz="0 1 0"/>
  <limit lower="0.01" upper="0.05" effort="1" velocity="1"/></joint>
<joint name="right" type="{kind}"><parent link="palm"/><child link="b"/><axis xyz="{axis}"/><origin rpy="{rpy}"/>
  <limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>{mimic}</joint></robot>"""
RIGHT = {"kind": "prismatic", "axis": "0 -1 0", "rpy": "0 0 0", "lower": 0.01, "upper": 0.05, "mimic": ""}


def jaws(**changes: object) -> tuple[Joint, Joint]:
    left, right = read_urdf(URDF.format(**RIGHT | changes)).joints
    return left, right


@pytest.mark.parametrize(
    ("changes", "multiplier"),
    [
        ({}, 1.0),
        ({"axis": "0 -2 0"}, 1.0),
        ({"axis": "0 1 0", "rpy": "0 0 3.14"}, 1.0),
        ({"axis": "0 1 0", "lower": -0.05, "upper": -0.01}, -1.0),
        ({"axis": "0 -1 0", "rpy": "0 0 3.14159", "lower": -0.05, "upper": -0.01}, -1.0),
        ({"axis": "0 1 0"}, 0.0),
        ({"lower": -0.05, "upper": -0.01}, 0.0),
        ({"upper": 0.04}, 0.0),
        ({"axis": "0 -1 0.01"}, 0.0),
        ({"kind": "revolute"}, 0.0),
        ({"mimic": '<mimic joint="left"/>'}, 0.0),
    ],
    ids=str,
)
def test_a_mirrored_jaw_has_opposite_axis_or_opposite_limits(changes: dict[str, object], multiplier: float) -> None:
    left, right = jaws(**changes)
    assert mirror_multiplier(left, right) == mirror_multiplier(right, left) == multiplier


def test_a_joint_with_a_symmetric_range_does_not_mirror_itself() -> None:
    _, right = jaws(lower=-0.05, upper=0.05)
    assert mirror_multiplier(right, right) == 0.0
