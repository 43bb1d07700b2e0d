# SPDX-License-Identifier: BSD-3-Clause
"""A gripper with four-bar fingers closes through its whole stroke and holds what it grasps, in every engine.

As in public descriptions, the limits of its mimic joints forbid their relation, and its links have no <inertial>.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import Drive, Mode, RobotBody
from modular_framework_simulation.physics.simulated_body import SimulatedBody
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.simulation.simulated_samples import solid

sys.path.insert(0, str(Path(__file__).parents[1]))
from linkage_hands import four_bar_parts  # noqa: E402

CLOSED, OPENING_M = 0.8, 0.0859
EFFORT = 5.0  # about 100 N between the pads [N m]
HEIGHT_M, PADS_M = 0.08, 0.05  # of the object and of the open pads; these come 14 mm lower as they close
ROBOT = """<robot name="hand"><link name="world"/>
<joint name="lift" type="prismatic"><parent link="world"/><child link="slide"/><origin xyz="0 0 0.5"/>
  <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1000" velocity="1"/></joint>
<link name="slide"><inertial><mass value="3"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
</inertial></link><joint name="mount" type="fixed"><parent link="slide"/><child link="palm"/>
  <origin rpy="3.14159265 0 0"/></joint>{hand}</robot>"""


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Every engine."""
    name: str = request.param
    return name


class Hand:
    """The hand on a vertical slide, and how far its mimic joints were from their relation at most [rad]."""

    def __init__(self, world: PhysicsWorld, parts: ConvexParts) -> None:
        text = ROBOT.format(hand=four_bar_parts(lower=0.0, effort=EFFORT, inner_knuckle=0.01))
        self.description = read_robot(text, str, parts, False)
        self.robot = RobotBody(world, self.description, "hand", Pose(), {})
        self.world, self.error = world, 0.0
        self._commands = {"lift": 0.0, "drive": 0.0}

    @property
    def body(self) -> SimulatedBody:
        return self.robot.body

    def move(self, seconds: float, **goal: float) -> None:
        """Moves joints to their goals along a smooth curve in the first 80 % of the time."""
        step_s = self.world.settings.time_step_s
        start, count = dict(self._commands), round(seconds / step_s)
        for number in range(1, count + 1):
            share = min(1.0, 1.25 * number / count)
            blend = share**3 * (10 - 15 * share + 6 * share**2)
            drives = {}
            for name, effort in (("lift", 1000.0), ("drive", EFFORT)):
                command = start[name] + blend * (goal.get(name, start[name]) - start[name])
                drives[name] = Drive(Mode.POSITION, command, (command - self._commands[name]) / step_s, effort)
                self._commands[name] = command
            self.robot.read()
            self.robot.drive(drives)
            self.world.step()
            self.error = max(self.error, self._mimic_error())

    def _mimic_error(self) -> float:
        positions = {
            name: state.position for name, state in zip(self.robot.joint_names, self.robot.read(), strict=True)
        }
        return max(
            abs(positions[joint.name] - joint.mimic.multiplier * positions["drive"])
            for joint in self.description.joints
            if joint.mimic is not None
        )

    def position(self, joint: str) -> float:
        return self.robot.readings[self.robot.joint_names.index(joint)].position

    def gap(self) -> float:
        """Distance between the faces of the pads [m]."""
        left, right = (self.body.link_state(f"{side}_pad").pose.position[1] for side in ("left", "right"))
        return abs(left - right) - 0.00635


@pytest.fixture
def hand(world: PhysicsWorld, convex_parts: ConvexParts) -> Hand:
    return Hand(world, convex_parts)


def test_the_fingers_of_an_empty_hand_close_through_the_whole_stroke(hand: Hand) -> None:
    assert hand.gap() == pytest.approx(OPENING_M, abs=5e-4)
    hand.move(1.0, drive=CLOSED)
    assert hand.position("drive") == pytest.approx(CLOSED, abs=1e-3)
    assert hand.gap() < 0.005
    assert hand.error < 1e-3


@pytest.mark.parametrize("width", [0.02, 0.06])
def test_an_object_is_lifted_by_friction_and_stays_where_it_is_between_the_pads(
    world: PhysicsWorld, hand: Hand, width: float
) -> None:
    thing = world.spawn(solid("thing", specs.Box((width, width, HEIGHT_M)), Pose((0.0, 0.0, HEIGHT_M / 2))))
    down = PADS_M - hand.body.link_state("left_pad").pose.position[2]
    hand.move(1.0, lift=down)
    hand.move(1.0, drive=CLOSED)
    assert hand.gap() == pytest.approx(width, abs=1e-3)
    in_hand = hand.body.link_state("palm").pose.inverse() @ thing.state().pose
    hand.move(1.0, lift=down + 0.2)
    hand.move(1.0)
    slip, turn = in_hand.distance_to(hand.body.link_state("palm").pose.inverse() @ thing.state().pose)
    assert thing.state().pose.position[2] == pytest.approx(HEIGHT_M / 2 + 0.2, abs=2e-3)
    assert slip < 1e-3 and turn < 0.02
    assert hand.gap() == pytest.approx(width, abs=1e-3)
    assert hand.error < 0.005  # when the pads meet the object


def test_both_bars_of_a_finger_are_one_finger_and_its_pad_belongs_to_it(hand: Hand) -> None:
    (gripper,) = hand.robot.grippers
    names = {index: name for name, index in hand.body.link_indices.items()}
    assert gripper.palm_link == "palm"
    assert [{names[index] for index in finger} for finger in gripper.fingers] == [
        {f"{side}_{part}" for part in ("knuckle", "finger", "inner_finger", "pad", "inner_knuckle")}
        for side in ("left", "right")
    ]


def test_links_without_inertial_weigh_as_much_as_water_in_their_shapes_and_frames_nothing(
    world: PhysicsWorld, convex_parts: ConvexParts
) -> None:
    box = '<collision><origin xyz="0.1 0 0"/><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'
    text = f"""<robot name="r"><link name="base"/><link name="block">{box}</link><link name="frame"/>
<joint name="hinge" type="continuous"><parent link="base"/><child link="block"/></joint>
<joint name="tip" type="fixed"><parent link="block"/><child link="frame"/></joint></robot>"""
    robot = RobotBody(world, read_robot(text, str, convex_parts, False), "r", Pose(), {})
    block, frame = (
        world.engine.mass_properties(robot.body.number, robot.body.link_indices[name]) for name in ("block", "frame")
    )
    assert block.mass == pytest.approx(6.0)
    assert block.centre_in_link.position == pytest.approx((0.1, 0.0, 0.0))
    assert sorted(block.moments) == pytest.approx(sorted((6 / 12 * 0.13, 6 / 12 * 0.10, 6 / 12 * 0.05)))
    assert frame.mass < 1e-4
