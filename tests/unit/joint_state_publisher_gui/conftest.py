# SPDX-License-Identifier: BSD-3-Clause
"""A robot with joints of every kind."""

from __future__ import annotations

import os

import pytest

from modular_framework_urdf.robot import Robot
from modular_framework_urdf.urdf_reader import read_urdf

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

JOINTS = {
    "lift": ("prismatic", '<limit lower="0.1" upper="0.5" effort="1" velocity="1"/>'),
    "turn": (
        "revolute",
        '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
        '<safety_controller soft_lower_limit="-0.5" soft_upper_limit="3" k_velocity="1"/>',
    ),
    "wheel": ("continuous", ""),
    "mount": ("fixed", ""),
    "finger": ("prismatic", '<limit lower="0" upper="0.04" effort="1" velocity="1"/>'),
    "other_finger": (
        "prismatic",
        '<mimic joint="finger" multiplier="-2" offset="0.01"/><limit lower="-1" upper="1" effort="1" velocity="1"/>',
    ),
    "tip": (
        "revolute",
        '<mimic joint="other_finger" offset="0.5"/><limit lower="-1" upper="1" effort="1" velocity="1"/>',
    ),
    "stuck": ("revolute", '<limit lower="0" upper="0" effort="1" velocity="1"/>'),
}


def description(joints: dict[str, tuple[str, str]]) -> str:
    """Returns a URDF whose joints all hang on one link."""
    links = "".join(f'<link name="{name}_link"/>' for name in joints)
    texts = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="base"/><child link="{name}_link"/>{inner}</joint>'
        for name, (kind, inner) in joints.items()
    )
    return f'<robot name="all_kinds"><link name="base"/>{links}{texts}</robot>'


@pytest.fixture
def robot() -> Robot:
    return read_urdf(description(JOINTS))
