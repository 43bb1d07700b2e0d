# SPDX-License-Identifier: BSD-3-Clause
"""moveit_commander and move_group read the same limits of joints, whatever joint_limits.yaml says."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("moveit_commander", reason="source the workspace")

from moveit_commander.robot_model import RobotModel as ClientModel  # noqa: E402

from modular_framework_planning.robot_model.robot_model import RobotModel  # noqa: E402

JOINTS = {"turn": "revolute", "slide": "prismatic", "roll": "continuous"}
URDF = """<robot name="r"><link name="root"/>
<joint name="turn" type="revolute"><parent link="root"/><child link="a"/>
<limit lower="-1" upper="1" velocity="2" effort="1"/>
<safety_controller k_velocity="1" soft_lower_limit="-0.9" soft_upper_limit="2"/></joint><link name="a"/>
<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/>
<limit lower="0" upper="0.3" effort="1" velocity="0"/>
</joint><link name="b"/>
<joint name="roll" type="continuous"><parent link="b"/><child link="c"/><limit velocity="3" effort="1"/></joint>
<link name="c"/></robot>"""
SRDF = """<robot name="r"><group name="arm"><chain base_link="root" tip_link="c"/></group></robot>"""

FLAGS = st.fixed_dictionaries(
    {},
    optional={f"has_{kind}_limits": st.booleans() for kind in ("position", "velocity", "acceleration")}
    | {"min_position": st.floats(-3.0, -0.1), "max_position": st.floats(0.1, 3.0)}
    | {"max_velocity": st.floats(0.1, 9.0), "max_acceleration": st.floats(0.1, 9.0)},
)


@settings(max_examples=50, deadline=None)
@given(st.fixed_dictionaries({}, optional=dict.fromkeys(JOINTS, FLAGS)))
def test_commander_and_move_group_agree_on_limits(entries: dict[str, Any]) -> None:
    server, client = RobotModel(URDF, SRDF, entries), ClientModel(URDF, SRDF, entries)
    for name, kind in JOINTS.items():
        ours, theirs = server.limits[name], client.joints[name]
        assert (ours.velocity, ours.acceleration) == (theirs.velocity, theirs.acceleration)
        assert server.is_continuous(server.index[name]) == (theirs.kind == "continuous") == (kind == "continuous")
        if kind != "continuous":
            assert (ours.lower, ours.upper) == (theirs.lower, theirs.upper)


def test_looser_limits_are_noted() -> None:
    entries = {"turn": {"max_velocity": 9.0}, "roll": {"has_position_limits": True, "max_position": 1.0}}
    assert [note.split(";")[0] for note in RobotModel(URDF, SRDF, entries).notes] == [
        "joint_limits/turn: max_velocity 9 is looser than the URDF's 2, but is used",
        "joint_limits/roll: has_position_limits is ignored, because the joint is continuous",
    ]
