# SPDX-License-Identifier: BSD-3-Clause
"""Independent joints keep their limits, mimic joints follow, and values of sources are adopted unchanged."""

from __future__ import annotations

import math
import random

import pytest
from joint_sliders.joint_values import JointValues
from joint_sliders.slider_joints import SliderSettings, slider_joints

from modular_framework_urdf.mimics import Mimic
from modular_framework_urdf.robot import Robot
from modular_framework_urdf.urdf_reader import read_urdf

MOVABLE = ("lift", "turn", "wheel", "finger", "other_finger", "tip", "stuck")


def values_of(robot: Robot, settings: SliderSettings | None = None, **known: bool) -> JointValues:
    return JointValues(slider_joints(robot, settings or SliderSettings()), **known)


def positions(values: JointValues) -> dict[str, float]:
    arrays = values.arrays()
    return dict(zip(arrays.names, arrays.positions, strict=True))


def test_limits_are_the_smallest_and_zeros_within_them(robot: Robot) -> None:
    free = slider_joints(robot, SliderSettings()).free
    assert {name: (joint.lower, joint.upper, joint.zero) for name, joint in free.items()} == {
        "lift": (0.1, 0.5, pytest.approx(0.3)),  # 0 is not within its limits
        "turn": (-0.5, 2.0, 0.0),
        "wheel": (-math.pi, math.pi, 0.0),
        "finger": (0.0, 0.04, 0.0),
        "stuck": (0.0, 0.0, 0.0),
    }
    assert [free[name].unit for name in ("lift", "turn")] == ["m", "rad"]
    assert not free["stuck"].has_range


def test_soft_limits_may_be_ignored(robot: Robot) -> None:
    turn = slider_joints(robot, SliderSettings(use_smallest_joint_limits=False)).free["turn"]
    assert (turn.lower, turn.upper) == (-1.0, 2.0)


def test_mimic_joints_follow_through_a_chain(robot: Robot) -> None:
    values = values_of(robot)
    values.set_position("finger", 0.03)
    found = positions(values)
    assert tuple(found) == MOVABLE, "in the order of the description, without the fixed joint"
    assert found["other_finger"] == pytest.approx(-2 * 0.03 + 0.01) and found["tip"] == pytest.approx(-0.05 + 0.5)


def test_mimic_joints_are_independent_without_use_mimic_tags(robot: Robot) -> None:
    joints = slider_joints(robot, SliderSettings(use_mimic_tags=False))
    assert set(joints.free) == set(MOVABLE) and not joints.following


def test_dependent_joints_follow_as_mimic_joints_do(robot: Robot) -> None:
    values = values_of(robot, SliderSettings(dependent_joints={"turn": Mimic("lift", 3.0, 0.1)}))
    values.set_position("lift", 0.5)
    assert positions(values)["turn"] == pytest.approx(3 * 0.5 + 0.1)
    with pytest.raises(KeyError):
        values.set_position("turn", 0.0)


def test_zeros_are_the_positions_at_startup_and_after_centring(robot: Robot) -> None:
    joints = slider_joints(robot, SliderSettings(zeros={"turn": 1.25, "lift": 0.123456789, "wheel": 0.0}))
    values = JointValues(joints)
    values.randomise(random.Random(1))
    assert positions(values)["lift"] != 0.123456789
    values.centre()
    found = positions(values)
    assert (found["turn"], found["lift"], found["wheel"]) == (1.25, 0.123456789, 0.0)
    assert not joints.warnings


def test_unusable_zeros_and_dependent_joints_cause_warnings(robot: Robot) -> None:
    settings = SliderSettings(zeros={"turn": 9.0, "trun": 1.0}, dependent_joints={"nose": Mimic("lift", 1.0, 0.0)})
    joints = slider_joints(robot, settings)
    text = "\n".join(joints.warnings)
    assert joints.free["turn"].zero == 2.0 and "zeros/turn: 9.0 is outside [-0.5, 2.0]; 2.0 is used" in text
    assert "no movable joint 'trun'; allowed: lift, turn" in text and "no movable joint 'nose'" in text


def test_a_position_set_in_the_window_keeps_the_limits(robot: Robot) -> None:
    values = values_of(robot)
    values.set_position("turn", 5.0)
    values.set_position("wheel", 4.0)
    assert values.positions()["turn"] == 2.0
    assert values.positions()["wheel"] == pytest.approx(4.0 - 2 * math.pi), "a continuous joint wraps"


def test_random_positions_keep_the_limits_and_differ(robot: Robot) -> None:
    joints = slider_joints(robot, SliderSettings())
    values, generator = JointValues(joints), random.Random(0)
    seen = set()
    for _ in range(50):
        values.randomise(generator)
        found = values.positions()
        seen.add(found["turn"])
        assert all(joint.lower <= found[name] <= joint.upper for name, joint in joints.free.items())
    assert len(seen) == 50


def test_values_of_a_source_are_adopted_unchanged(robot: Robot) -> None:
    values = values_of(robot)
    values.receive(["wheel", "nose", "finger"], [7.654321, 1.0, 0.0123456789], [], [1.0, 2.0, 3.0])
    found = positions(values)
    assert found["wheel"] == 7.654321 and found["finger"] == 0.0123456789 and found["lift"] == pytest.approx(0.3)
    arrays = values.arrays()
    assert arrays.velocities == () and arrays.efforts[MOVABLE.index("wheel")] == 1.0
    assert found["other_finger"] == pytest.approx(-2 * 0.0123456789 + 0.01)


def test_velocities_of_mimic_joints_are_scaled(robot: Robot) -> None:
    values = values_of(robot, velocities=True)
    assert values.arrays().velocities == (0.0,) * len(MOVABLE)
    values.receive(["finger"], [], [0.5], [])
    assert values.arrays().velocities[MOVABLE.index("other_finger")] == -1.0


def test_positions_may_be_unknown_until_a_joint_is_moved(robot: Robot) -> None:
    values = values_of(robot, positions=False)
    assert values.arrays().names == MOVABLE and values.arrays().positions == ()
    values.set_position("lift", 0.2)
    assert len(values.arrays().positions) == len(MOVABLE)


def test_a_sweep_reverses_at_limits_and_wraps_continuous_joints(robot: Robot) -> None:
    values = values_of(robot)
    seen: dict[str, list[float]] = {"turn": [], "wheel": []}
    for _ in range(200):
        values.sweep(0.1)
        for name in seen:
            seen[name].append(values.positions()[name])
    assert max(seen["turn"]) == 2.0 and min(seen["turn"]) == -0.5
    steps = [later - earlier for earlier, later in zip(seen["wheel"], seen["wheel"][1:], strict=False)]
    assert all(step == pytest.approx(0.1) or step == pytest.approx(0.1 - 2 * math.pi) for step in steps)
    assert min(steps) < 0 < max(steps)


BROKEN = {
    "joint 'a' has the range [1.0, -1.0]; allowed": ("revolute", '<limit lower="1" upper="-1"/>'),
    "it mimics 'nobody', which is not a movable joint": (
        "revolute",
        '<mimic joint="nobody"/><limit lower="0" upper="1"/>',
    ),
    "it mimics itself": ("revolute", '<mimic joint="a"/><limit lower="0" upper="1"/>'),
}


@pytest.mark.parametrize("message", BROKEN)
def test_an_invalid_joint_is_refused(message: str) -> None:
    kind, inner = BROKEN[message]
    text = f'<robot name="r"><link name="l"/><link name="m"/>\n<joint name="a" type="{kind}"><parent link="l"/>'
    with pytest.raises(ValueError, match="URDF joint 'a'|robot_description:2") as caught:
        slider_joints(read_urdf(f'{text}<child link="m"/>{inner}</joint></robot>'), SliderSettings())
    assert message in str(caught.value)


def test_a_joint_without_limits_is_published_but_not_moved() -> None:
    text = '<robot name="r"><link name="l"/><link name="m"/><joint name="a" type="revolute"><parent link="l"/>'
    joints = slider_joints(read_urdf(f'{text}<child link="m"/></joint></robot>'), SliderSettings())
    assert "joint 'a' has no <limit>" in joints.warnings[0]
    assert JointValues(joints).arrays().positions == (0.0,) and not joints.free["a"].has_range
