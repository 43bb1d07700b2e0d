# SPDX-License-Identifier: BSD-3-Clause
"""Forces act as Newton says, for as long as asked; masses, joints and the physics can be changed while time passes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from modular_framework_simulation.errors import AmbiguousNameError, ModelChangeError, UnknownEntityError
from modular_framework_simulation.loop.pacing import Pacer
from modular_framework_simulation.loop.request_queue import RequestQueue
from modular_framework_simulation.loop.simulation_loop import Hook, SimulationLoop
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources, no_packages
from modular_framework_simulation.physics.applied_forces import Interval, JointEffort, LinkWrench
from modular_framework_simulation.physics.body_joints import measured_joint
from modular_framework_simulation.physics.body_links import couple, measured_inertial
from modular_framework_simulation.physics.model_changes import (
    JointChange,
    set_inertial,
    set_joint,
    set_joint_positions,
    set_link_state,
)
from modular_framework_simulation.physics.part_names import PartName, find_frame, find_joint, find_link
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import WORLD_FRAMES, PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_body import BodyState, JointSettings, Twist, cross
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.simulation.simulated_samples import lift_robot_urdf, solid

NOWHERE = (0.0, 0.0, 0.0)
CUBE = specs.Box((0.05, 0.05, 0.05))
LINK = PartName("cube", "link")
HINGE = PartName("door", "hinge")
MASS = "<inertial><mass>{}</mass><inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial>"
SHAPE = "<collision name='c'><geometry><box><size>.1 .1 .1</size></box></geometry></collision>"
DOOR = f"""<sdf version='1.6'><model name='door'><link name='post'>{MASS.format(5)}{SHAPE}</link>
    <link name='leaf'><pose>0.4 0 0 0 0 0</pose>{MASS.format(0.5)}{SHAPE}</link>
    <joint name='fast' type='fixed'><parent>world</parent><child>post</child></joint>
    <joint name='hinge' type='revolute'><pose>-0.4 0 0 0 0 0</pose><parent>post</parent><child>leaf</child>
    <axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper></limit></axis></joint></model></sdf>"""
DOOR_INERTIA = 0.01 + 0.5 * 0.4**2
CHAIN = DOOR.replace("<joint name='fast' type='fixed'><parent>world</parent><child>post</child></joint>", "").replace(
    "'door'", "'chain'"
)


@pytest.fixture
def space(convex_parts: ConvexParts) -> PhysicsWorld:
    """A world without gravity."""
    return PhysicsWorld(PhysicsSettings(), convex_parts, NOWHERE)


def run(world: PhysicsWorld, seconds: float) -> None:
    for _ in range(round(seconds / world.settings.time_step_s)):
        world.step()


def door(world: PhysicsWorld, height: float = 2.0) -> None:
    model = read_model_text(DOOR, "text", Resources())
    world.spawn(replace(model, pose=Pose((0, 0, height))))


def push(
    link: PartName, force: tuple[float, float, float], torque: tuple[float, float, float], end_s: float
) -> LinkWrench:
    return LinkWrench(link, force, torque, Interval(0, round(end_s * 1e9)))


def test_a_force_gives_the_momentum_of_its_duration_and_then_ends(space: PhysicsWorld) -> None:
    body = space.spawn(solid("cube", CUBE, Pose.from_xyz_rpy((0, 0, 1), (0.3, 0.2, 1.0)), mass=0.2))
    space.forces.add_wrench(push(LINK, (1.0, -2.0, 0.5), NOWHERE, 0.1))
    run(space, 0.1)
    assert body.state().twist.linear == pytest.approx((0.5, -1.0, 0.25), rel=1e-3)
    run(space, 0.2)
    assert body.state().twist.linear == pytest.approx((0.5, -1.0, 0.25), rel=1e-3)
    assert body.state().twist.angular == pytest.approx(NOWHERE, abs=1e-9)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_a_torque_turns_a_tilted_body_about_its_axis_in_the_world(
    space: PhysicsWorld, axis: tuple[float, float, float]
) -> None:
    body = space.spawn(solid("cube", CUBE, Pose.from_xyz_rpy((0, 0, 1), (0.3, 0.2, 1.0)), mass=0.2))
    moment = 0.2 * 0.05**2 / 6
    x, y, z = (value * moment * 20 for value in axis)
    space.forces.add_wrench(push(LINK, NOWHERE, (x, y, z), 0.05))
    run(space, 0.05)
    assert body.state().twist.angular == pytest.approx(axis, abs=2e-3)
    assert body.state().twist.linear == pytest.approx(NOWHERE, abs=1e-6)


def test_a_couple_has_the_torque_it_was_made_for() -> None:
    for torque in ((1.0, 2.0, -3.0), (0.0, 0.0, 1e-3), (-5.0, 0.0, 0.0)):
        arm, force = couple(torque)
        assert math.hypot(*arm) == pytest.approx(1.0)
        assert cross(arm, force) == pytest.approx(torque)


def test_a_force_on_a_link_of_a_jointed_model_turns_the_joint(space: PhysicsWorld) -> None:
    door(space)
    space.forces.add_wrench(push(PartName("door", "leaf"), (0.0, 1.0, 0.0), NOWHERE, 0.1))
    run(space, 0.1)
    velocity = measured_joint(space.engine, space.body("door"), "hinge").velocity
    assert velocity == pytest.approx(0.4 * 0.1 / DOOR_INERTIA, rel=0.01)


def test_a_force_begins_when_asked_and_a_short_one_lasts_one_step(space: PhysicsWorld) -> None:
    body = space.spawn(solid("cube", CUBE, Pose((0, 0, 1)), mass=0.2))
    step_s = space.settings.time_step_s
    space.forces.add_wrench(LinkWrench(LINK, (1.0, 0, 0), NOWHERE, Interval.from_request(0, 100_000_000, 1)))
    run(space, 0.1)
    assert body.state().twist.linear[0] == pytest.approx(0.0, abs=1e-12)
    run(space, 0.1)
    assert body.state().twist.linear[0] == pytest.approx(step_s / 0.2, rel=1e-6)


def test_a_force_without_end_acts_until_it_is_cleared_or_the_world_is_reset(space: PhysicsWorld) -> None:
    body = space.spawn(solid("cube", CUBE, Pose((0, 0, 1)), mass=0.2))
    endless = LinkWrench(LINK, (1.0, 0, 0), NOWHERE, Interval.from_request(0, 0, -1))
    for stop in (lambda: space.forces.clear_link(LINK), space.reset_poses):
        space.forces.add_wrench(endless)
        run(space, 0.1)
        before = body.state().twist.linear[0]
        assert before > 0.4
        stop()
        run(space, 0.1)
        assert body.state().twist.linear[0] <= before + 1e-9


def test_forces_end_with_their_model(space: PhysicsWorld) -> None:
    model = solid("cube", CUBE, Pose((0, 0, 1)), mass=0.2)
    space.spawn(model)
    space.forces.add_wrench(LinkWrench(LINK, (1.0, 0, 0), NOWHERE, Interval(0, None)))
    space.delete("cube")
    body = space.spawn(model)
    run(space, 0.1)
    assert body.state().twist.linear == pytest.approx(NOWHERE, abs=1e-12)


def test_an_effort_turns_a_joint_for_its_duration_and_several_add_up(space: PhysicsWorld) -> None:
    door(space)
    for effort in (0.03, 0.06):
        space.forces.add_effort(JointEffort(HINGE, effort, Interval(0, 100_000_000)))
    run(space, 0.3)
    velocity = measured_joint(space.engine, space.body("door"), "hinge").velocity
    assert velocity == pytest.approx(0.09 * 0.1 / DOOR_INERTIA, rel=0.01)


def test_an_effort_on_a_joint_of_the_robot_adds_to_its_drive(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    description = read_robot(lift_robot_urdf(), no_packages, convex_parts, False)
    robot = RobotBody(world, description, "lifter", Pose(), {"lift": 0.1})
    world.forces.add_effort(JointEffort(PartName("lifter", "lift"), 2.2 * (9.81 + 1.0), Interval(0, None)))
    for _ in range(100):
        robot.read()
        robot.drive({})
        world.step()
    assert measured_joint(world.engine, robot.body, "lift").velocity == pytest.approx(0.2, rel=0.05)


def test_a_link_without_weight_floats(world: PhysicsWorld) -> None:
    body = world.spawn(solid("cube", CUBE, Pose((0, 0, 1))))
    inertial = measured_inertial(world.engine, body, "link")
    assert set_inertial(world, LINK, inertial, gravity=False)
    run(world, 0.5)
    assert world.entity_state("cube").pose.position[2] == pytest.approx(1.0, abs=1e-6)
    assert set_inertial(world, LINK, inertial, gravity=True)
    run(world, 0.1)
    assert world.entity_state("cube").twist.linear[2] == pytest.approx(-0.981, rel=0.01)


def test_a_new_mass_counts_from_the_next_step_and_the_motion_goes_on(space: PhysicsWorld) -> None:
    space.spawn(solid("cube", CUBE, Pose((0, 0, 1)), mass=0.2))
    space.set_state("cube", BodyState(Pose((0, 0, 1)), Twist((0.0, 0.1, 0.0), (0.0, 0.0, 0.5))))
    wanted = specs.Inertial(Pose((0.0, 0.0, 0.02)), 0.8, (2e-3, 3e-4, 0.0, 1.5e-3, 1e-4, 1e-3))
    assert set_inertial(space, LINK, wanted)
    found = measured_inertial(space.engine, space.body("cube"), "link")
    assert found.mass == 0.8
    assert found.pose.position == pytest.approx(wanted.pose.position, abs=1e-9)
    assert found.inertia == pytest.approx(wanted.inertia, abs=1e-9)
    assert not set_inertial(space, LINK, found), "what was read changes nothing"
    assert space.body("cube").state().twist.angular == pytest.approx((0, 0, 0.5), abs=1e-6)
    space.forces.add_wrench(push(LINK, (2.0, 0.0, 0.0), NOWHERE, 0.1))
    run(space, 0.1)
    assert space.body("cube").state().twist.linear[0] == pytest.approx(0.25, rel=0.02)
    space.restart()
    assert space.names() == []


def test_a_model_that_was_created_again_keeps_its_name_and_place_among_the_others(space: PhysicsWorld) -> None:
    for name in ("cube", "other"):
        space.spawn(solid(name, CUBE, Pose((0, 0, 1))))
    instance = space.instance("cube")
    set_inertial(space, LINK, specs.Inertial(Pose(), 3.0, (0.01, 0, 0, 0.01, 0, 0.01)))
    assert space.names() == ["cube", "other"]
    assert space.instance("cube") == instance
    assert space.entity_state("cube").pose.position == pytest.approx((0, 0, 1))


@pytest.mark.parametrize(
    ("mass", "inertia", "said"),
    [
        (0.0, (1e-3, 0, 0, 1e-3, 0, 1e-3), "mass is 0 kg"),
        (-1.0, (1e-3, 0, 0, 1e-3, 0, 1e-3), "mass is -1 kg"),
        (1.0, (0, 0, 0, 0, 0, 0), "not positive definite"),
        (1.0, (1e-3, 2e-3, 0, 1e-3, 0, 1e-3), "not positive definite"),
    ],
)
def test_a_mass_that_nothing_has_is_refused(
    space: PhysicsWorld, mass: float, inertia: tuple[float, float, float, float, float, float], said: str
) -> None:
    space.spawn(solid("cube", CUBE, Pose()))
    with pytest.raises(ModelChangeError, match=said):
        set_inertial(space, LINK, specs.Inertial(Pose(), mass, inertia))


def test_the_robot_and_static_models_keep_what_their_description_says(
    world: PhysicsWorld, convex_parts: ConvexParts
) -> None:
    robot = RobotBody(world, read_robot(lift_robot_urdf(), no_packages, convex_parts, False), "lifter", Pose(), {})
    heavy = specs.Inertial(Pose(), 9.0, (0.1, 0, 0, 0.1, 0, 0.1))
    for link, said in ((PartName("lifter", "palm"), "the controlled robot"), (PartName("floor", "link"), "static")):
        with pytest.raises(ModelChangeError, match=said):
            set_inertial(world, link, heavy)
    assert measured_inertial(world.engine, robot.body, "palm").mass == 2.0
    for change in (JointChange(0.0, 0.1, JointSettings()), JointChange(None, None, JointSettings(None, 1.0, 1.0))):
        with pytest.raises(ModelChangeError, match="the controlled robot"):
            set_joint(world, PartName("lifter", "lift"), change)
    with pytest.raises(ModelChangeError, match="the controlled robot"):
        set_link_state(world, PartName("lifter", "palm"), BodyState(Pose(), Twist()), "")


def test_new_limits_stop_a_joint(space: PhysicsWorld) -> None:
    door(space)
    set_joint(space, HINGE, JointChange(-0.1, 0.3, JointSettings()))
    space.forces.add_effort(JointEffort(HINGE, 0.1, Interval(0, None)))
    run(space, 2.0)
    found = measured_joint(space.engine, space.body("door"), "hinge")
    assert (found.lower, found.upper) == pytest.approx((-0.1, 0.3))
    assert found.position == pytest.approx(0.3, abs=0.02)
    with pytest.raises(ModelChangeError, match=r"lower limit 0\.5 is above the upper limit 0\.3"):
        set_joint(space, HINGE, JointChange(0.5, None, JointSettings()))


def test_a_motor_brings_a_joint_to_its_velocity_and_survives_a_change_of_mass(space: PhysicsWorld) -> None:
    door(space)
    set_joint(space, HINGE, JointChange(-math.inf, math.inf, JointSettings(None, 1.5, 5.0)))
    run(space, 0.5)
    assert measured_joint(space.engine, space.body("door"), "hinge").velocity == pytest.approx(1.5, abs=0.01)
    set_inertial(space, PartName("door", "leaf"), specs.Inertial(Pose(), 1.0, (0.01, 0, 0, 0.01, 0, 0.01)))
    run(space, 0.5)
    assert measured_joint(space.engine, space.body("door"), "hinge").velocity == pytest.approx(1.5, abs=0.01)


def test_damping_slows_a_joint_as_the_exponential_says(space: PhysicsWorld) -> None:
    door(space)
    set_joint(space, HINGE, JointChange(-math.inf, math.inf, JointSettings(damping=0.05)))
    assert measured_joint(space.engine, space.body("door"), "hinge").damping == 0.05
    space.forces.add_effort(JointEffort(HINGE, 1.0, Interval(0, 100_000_000)))
    run(space, 0.1)
    before = measured_joint(space.engine, space.body("door"), "hinge").velocity
    run(space, 0.5)
    after = measured_joint(space.engine, space.body("door"), "hinge").velocity
    assert after / before == pytest.approx(math.exp(-0.05 / DOOR_INERTIA * 0.5), rel=0.03)


def test_joint_positions_are_set_within_the_limits_only(space: PhysicsWorld) -> None:
    door(space)
    set_joint_positions(space, "door", {"hinge": 1.0})
    assert measured_joint(space.engine, space.body("door"), "hinge").position == pytest.approx(1.0)
    with pytest.raises(ModelChangeError, match="'door::hinge': got 2.5; allowed: -2 to 2 rad"):
        set_joint_positions(space, "door", {"hinge": 2.5})
    with pytest.raises(UnknownEntityError, match="no movable joint 'door::fast'"):
        set_joint_positions(space, "door", {"fast": 0.0})
    assert measured_joint(space.engine, space.body("door"), "hinge").position == pytest.approx(1.0)


def test_a_link_that_is_put_somewhere_takes_its_model_along(space: PhysicsWorld) -> None:
    space.spawn(replace(read_model_text(CHAIN, "text", Resources()), pose=Pose((0, 0, 1))))
    set_joint_positions(space, "chain", {"hinge": 0.5})
    leaf = PartName("chain", "leaf")
    wanted = BodyState(Pose.from_xyz_rpy((2, 0, 3), (0.1, 0, 0.2)), Twist((0.1, 0, 0), (0, 0, 1.0)))
    set_link_state(space, leaf, wanted, "")
    found = space.entity_state(leaf.scoped_name)
    assert found.pose.distance_to(wanted.pose)[0] < 1e-6
    assert found.twist.linear == pytest.approx((0.1, 0, 0), abs=1e-6)
    assert found.twist.angular == pytest.approx((0, 0, 1.0), abs=1e-6)
    assert measured_joint(space.engine, space.body("chain"), "hinge").position == pytest.approx(0.5)


def test_every_tree_of_a_model_has_its_masses_forces_and_motion(space: PhysicsWorld) -> None:
    free = CHAIN.split("<joint")[0] + "</model></sdf>"
    space.spawn(replace(read_model_text(free, "text", Resources()), pose=Pose((0, 0, 1))))
    leaf = PartName("chain", "leaf")
    space.forces.add_wrench(push(leaf, (1.0, 0.0, 0.0), NOWHERE, 0.1))
    run(space, 0.1)
    assert space.entity_state("chain::leaf").twist.linear[0] == pytest.approx(0.2, rel=1e-3)
    assert space.entity_state("chain::post").twist.linear == pytest.approx(NOWHERE, abs=1e-9)
    assert measured_inertial(space.engine, space.body("chain"), "leaf").mass == pytest.approx(0.5)
    assert set_inertial(space, leaf, specs.Inertial(Pose(), 1.0, (0.01, 0, 0, 0.01, 0, 0.01)))
    assert space.entity_state("chain::leaf").twist.linear[0] == pytest.approx(0.2, rel=1e-3)
    space.forces.add_wrench(push(leaf, (1.0, 0.0, 0.0), NOWHERE, 0.2))
    run(space, 0.1)
    assert space.entity_state("chain::leaf").twist.linear[0] == pytest.approx(0.3, rel=1e-3)


def test_a_link_is_put_relative_to_another(space: PhysicsWorld) -> None:
    space.spawn(solid("base", CUBE, Pose.from_xyz_rpy((1, 0, 0), (0, 0, math.pi / 2)), static=True))
    space.spawn(solid("cube", CUBE, Pose()))
    set_link_state(space, LINK, BodyState(Pose((1, 0, 0)), Twist()), "base::link")
    assert space.entity_state("cube::link").pose.position == pytest.approx((1, 1, 0))


def test_parts_are_found_by_full_name_and_alone_where_that_is_one(space: PhysicsWorld) -> None:
    door(space)
    for name in ("cube", "other"):
        space.spawn(solid(name, CUBE, Pose()))
    bodies = space.bodies
    assert find_link(bodies, "leaf") == find_link(bodies, "door::leaf") == PartName("door", "leaf")
    assert find_joint(bodies, "hinge") == HINGE
    assert find_frame(bodies, "leaf", WORLD_FRAMES) == "door::leaf"
    assert find_frame(bodies, "/map", WORLD_FRAMES) == "/map"
    with pytest.raises(AmbiguousNameError, match="2 models have a link 'link'.*cube::link, other::link"):
        find_link(bodies, "link")
    for name, said in (
        ("", "no link ''"),
        ("door", "no link 'door'"),
        ("mug::x", "no model 'mug'"),
        ("::", "no model ''"),
    ):
        with pytest.raises(UnknownEntityError, match=said):
            find_link(bodies, name)
    with pytest.raises(UnknownEntityError, match="no model 'nowhere'"):
        find_frame(bodies, "nowhere", WORLD_FRAMES)


def test_another_step_and_gravity_count_from_now_until_the_world_begins_again(space: PhysicsWorld) -> None:
    body = space.spawn(solid("cube", CUBE, Pose((0, 0, 5))))
    run(space, 0.1)
    space.set_physics(replace(space.settings, time_step_ns=1_000_000), (0.0, 0.0, -2.0))
    run(space, 0.5)
    assert space.time_ns == 600_000_000
    assert body.state().twist.linear[2] == pytest.approx(-1.0, rel=0.01)
    space.restart()
    assert (space.settings.time_step_ns, space.gravity) == (2_000_000, NOWHERE)


def test_hooks_keep_their_period_of_simulated_time_when_the_step_changes(space: PhysicsWorld) -> None:
    loop = SimulationLoop(space, Pacer(0.0), RequestQueue(), None)
    times: list[int] = []
    loop.add_hook(Hook(10_000_000, lambda: times.append(space.time_ns)))
    for step_ns in (2_000_000, 1_000_000):
        space.set_physics(replace(space.settings, time_step_ns=step_ns), NOWHERE)
        for _ in range(50_000_000 // step_ns):
            loop.step()
    assert [b - a for a, b in zip(times, times[1:], strict=False)] == [10_000_000] * 9


def test_a_reset_ends_requests_for_time_to_pass_and_says_why_to_the_controllers(
    make_world: Callable[[], PhysicsWorld],
) -> None:
    loop = SimulationLoop(make_world(), Pacer(0.0), RequestQueue(), None)
    loop.holds.hold("test", 10.0)
    asked = loop.holds.advance(1_000_000)
    loop.reset_all()
    assert asked.passed.is_set()
    assert loop.world.time_ns == 10_000_000, "a held clock does not stand at 0, which nodes take for not yet started"
