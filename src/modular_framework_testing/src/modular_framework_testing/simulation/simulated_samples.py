# SPDX-License-Identifier: BSD-3-Clause
"""Small models and a robot with two fingers."""

from __future__ import annotations

import math
from dataclasses import replace

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState

LIFT_ROBOT = """<robot name="lifter">
  <link name="world"/>
  <link name="palm"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>
  <joint name="lift" type="prismatic"><parent link="world"/><child link="palm"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 0 1"/><limit lower="-0.3" upper="0.5" effort="100" velocity="1"/></joint>
  {fingers}
  <transmission name="t1"><type>transmission_interface/SimpleTransmission</type>
    <joint name="lift"><hardwareInterface>{lift_interface}</hardwareInterface></joint>
    <actuator name="a1"><hardwareInterface>{lift_interface}</hardwareInterface></actuator></transmission>
  <transmission name="t2"><type>transmission_interface/SimpleTransmission</type>
    <joint name="slide_1"><hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint>
    <actuator name="a2"/></transmission>
</robot>"""

FINGER = """
  <link name="finger_{number}">
    <inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.03"/><geometry><box size="0.01 0.03 0.06"/></geometry></collision></link>
  <joint name="slide_{number}" type="prismatic"><parent link="palm"/><child link="finger_{number}"/>
    <origin xyz="{x} 0 0"/><axis xyz="{axis} 0 0"/><limit lower="0" upper="0.05" effort="20" velocity="0.2"/>
    {mimic}</joint>"""


def lift_robot_urdf(lift_interface: str = "hardware_interface/PositionJointInterface") -> str:
    """Returns the URDF of a palm on a vertical slide, with two fingers that close along x."""
    one = FINGER.format(number=1, x=-0.06, axis=1, mimic="")
    two = FINGER.format(number=2, x=0.06, axis=-1, mimic='<mimic joint="slide_1" multiplier="1" offset="0"/>')
    return LIFT_ROBOT.format(fingers=one + two, lift_interface=lift_interface)


def solid(
    name: str,
    geometry: specs.Geometry,
    pose: Pose,
    mass: float = 0.2,
    *,
    static: bool = False,
    surface: specs.Collision | None = None,
) -> specs.Model:
    """Returns a model with one link, called `link`, with one shape.

    Args:
        name: Name of the model.
        geometry: Shape.
        pose: Pose in the world.
        mass: Mass [kg].
        static: Whether the model never moves.
        surface: Collision with the friction and restitution of the shape; None for a friction coefficient of 0.8.
    """
    like = surface or specs.Collision("shape", Pose(), geometry, specs.Friction(0.8))
    collision = replace(like, geometry=geometry)
    moment = mass * 0.05**2 / 6
    inertial = specs.Inertial(Pose(), mass, (moment, 0, 0, moment, 0, moment))
    return specs.Model(name, pose, static, (specs.Link("link", Pose(), inertial, (collision,), ()),), (), "test")


def hinged_model(
    name: str,
    length: float,
    dynamics: specs.JointDynamics = specs.JointDynamics(),  # noqa: B008  (frozen)
    pose: Pose = Pose(),  # noqa: B008
) -> specs.Model:
    """Returns a bob of 0.5 kg and 0.001 kg m^2 at the end of a bar along x, on a hinge about y in the world.

    Args:
        name: Name of the model.
        length: Length of the bar [m].
        dynamics: Friction, damping and spring of the hinge.
        pose: Pose of the hinge in the world.
    """
    inertial = specs.Inertial(Pose(), 0.5, (0.001, 0, 0, 0.001, 0, 0.001))
    bob = specs.Link("bob", Pose((length, 0, 0)), inertial, (), ())
    hinge = specs.Joint(
        "hinge",
        specs.JointType.CONTINUOUS,
        specs.WORLD,
        "bob",
        pose=Pose((-length, 0, 0)),
        axis=(0, 1, 0),
        lower=-math.inf,
        upper=math.inf,
        dynamics=dynamics,
    )
    return specs.Model(name, pose, False, (bob,), (hinge,), "test")


def run(world: PhysicsWorld, seconds: float) -> None:
    """Simulates for some seconds."""
    for _ in range(round(seconds / world.settings.time_step_s)):
        world.step()


def exact_state(world: PhysicsWorld) -> tuple[int, dict[str, BodyState]]:
    """Returns time, poses and velocities of everything; equal states are equal bit for bit."""
    links = [(name, link) for name in world.names() for link in world.body(name).link_names()]
    return world.time_ns, {f"{name}::{link}": world.entity_state(f"{name}::{link}") for name, link in links}
