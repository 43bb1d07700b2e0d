# SPDX-License-Identifier: BSD-3-Clause
"""Bodies, and whole worlds, that are left out while they lie still move again when they would have moved anyway."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.loop.referee import Referee
from modular_framework_simulation.loop.snapshots import take_snapshot
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.physics.applied_forces import Interval, JointEffort, LinkWrench
from modular_framework_simulation.physics.engine_choice import ENGINES, PYBULLET
from modular_framework_simulation.physics.model_changes import JointChange, set_joint, set_joint_positions
from modular_framework_simulation.physics.part_names import PartName
from modular_framework_simulation.physics.physics_engine import BASE_INDEX
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import Drive, Mode, RobotBody
from modular_framework_simulation.physics.simulated_body import BodyState, JointSettings, Twist
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.simulation.simulated_samples import exact_state, run, solid

GRAVITY = 9.81
CUBE = specs.Box((0.05, 0.05, 0.05))
LONG_S = 4.0
TRAY = """<robot name="tray"><link name="world"/>
  <link name="plate"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial><collision><geometry><box size="0.2 0.2 0.02"/></geometry></collision></link>
  <joint name="lift" type="prismatic"><parent link="world"/><child link="plate"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/><limit lower="-0.45" upper="0.5" effort="500" velocity="1"/></joint>
  <transmission name="t"><type>transmission_interface/SimpleTransmission</type>
    <joint name="lift"><hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint>
    <actuator name="a"/></transmission></robot>"""
TOP = Pose((0, 0, 0.575))
WHEEL = """<sdf version='1.6'><model name='wheel'><pose>2 0 1 0 0 0</pose><link name='disc'>
  <inertial><mass>1</mass><inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial></link>
  <joint name='axle' type='revolute'><parent>world</parent><child>disc</child>
  <axis><xyz>0 0 1</xyz><dynamics><friction>0.01</friction></dynamics></axis></joint></model></sdf>"""
AXLE = PartName("wheel", "axle")

MakeWorld = Callable[..., PhysicsWorld]


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Every engine."""
    name: str = request.param
    return name


@pytest.fixture
def table(world: PhysicsWorld, engine: str) -> PhysicsWorld:
    """A world with a cube of 0.2 kg at rest on a table."""
    world.spawn(solid("table", specs.Box((1, 1, 0.1)), Pose((0, 0, 0.5)), static=True))
    world.spawn(solid("cube", CUBE, TOP))
    run(world, LONG_S)
    if engine == PYBULLET:
        assert world.entity_state("cube").twist == Twist()
    return world


def height(world: PhysicsWorld, name: str = "cube") -> float:
    return world.entity_state(name).pose.position[2]


def test_contact_forces_of_a_body_at_rest_are_its_weight(table: PhysicsWorld) -> None:
    assert sum(each.force for each in table.contacts(table.body("cube"), BASE_INDEX)) == pytest.approx(
        0.2 * GRAVITY, rel=0.01
    )


@pytest.mark.parametrize("fastened", [False, True])
def test_the_load_on_a_joint_of_a_body_that_lies_still_is_measured(world: PhysicsWorld, fastened: bool) -> None:
    crate = solid("crate", CUBE, Pose((0, 0, 0.025)))
    lid = replace(crate.links[0], name="lid", pose=Pose((0, 0, 0.05)))
    bolt = specs.Joint("bolt", specs.JointType.FIXED, "link", "lid", pose=Pose(), axis=(0, 0, 1), lower=0.0, upper=0.0)
    anchor = replace(bolt, name="anchor", parent=specs.WORLD, child="link")
    world.spawn(replace(crate, links=(*crate.links, lid), joints=(bolt, anchor) if fastened else (bolt,)))
    (tree,) = world.body("crate").parts
    joint = next(each for each in world.engine.joints(tree.number) if each.child_link == "lid")
    world.engine.measure_joint_load(tree.number, joint.index)
    run(world, LONG_S)
    force, _ = world.engine.joint_load(tree.number, joint.index)
    assert force == pytest.approx((0.0, 0.0, -0.2 * GRAVITY), abs=0.01)


def test_what_lay_on_a_model_falls_when_that_is_deleted(table: PhysicsWorld) -> None:
    table.delete("table")
    run(table, 1.0)
    assert height(table) == pytest.approx(0.025, abs=0.002)


def test_what_lay_on_a_model_falls_when_that_is_moved(table: PhysicsWorld) -> None:
    table.set_state("table", BodyState(Pose((3, 0, 0.5)), Twist()))
    run(table, 1.0)
    assert height(table) == pytest.approx(0.025, abs=0.002)


def test_what_lay_on_a_box_falls_when_that_is_moved(table: PhysicsWorld) -> None:
    table.spawn(solid("upper", CUBE, Pose((0, 0, 0.6251))))
    run(table, LONG_S)
    table.set_state("cube", BodyState(Pose((3, 0, 0.025)), Twist()))
    run(table, 0.5)
    assert height(table, "upper") == pytest.approx(0.575, abs=0.001)


def test_a_tower_falls_when_what_its_lowest_box_lay_on_is_moved(table: PhysicsWorld) -> None:
    table.spawn(solid("upper", CUBE, Pose((0, 0, 0.6251))))
    run(table, LONG_S)
    table.set_state("table", BodyState(Pose((3, 0, 0.5)), Twist()))
    run(table, 1.0)
    assert height(table, "upper") == pytest.approx(0.075, abs=0.003)


@pytest.mark.parametrize("spawned", [False, True])
def test_a_static_model_that_is_put_into_a_body_at_rest_pushes_it_out(table: PhysicsWorld, spawned: bool) -> None:
    shelf = solid("shelf", specs.Box((0.4, 0.4, 0.05)), Pose((0, 0, 0.55 if spawned else 3.0)), static=True)
    table.spawn(shelf)
    if not spawned:
        run(table, LONG_S)
        table.set_state("shelf", BodyState(Pose((0, 0, 0.55)), Twist()))
    run(table, 2.0)
    assert height(table) > 0.59


def test_a_robot_lifts_a_body_at_rest(make_world: MakeWorld, convex_parts: ConvexParts) -> None:
    world = make_world()
    tray = RobotBody(world, read_robot(TRAY, str, convex_parts, False), "tray", Pose(), {"lift": -0.2})
    for x in (-0.2, 0.2):
        world.spawn(solid(f"post_{x}", specs.Box((0.1, 0.1, 0.4)), Pose((x, 0, 0.2)), static=True))
    world.spawn(solid("beam", specs.Box((0.5, 0.05, 0.05)), Pose((0, 0, 0.425))))
    lift_m = -0.2
    for step in range(round(6.0 / world.settings.time_step_s)):
        lift_m = min(-0.2 + max(0.0, step * world.settings.time_step_s - LONG_S) * 0.2, 0.1)
        tray.read()
        tray.drive({"lift": Drive(Mode.POSITION, lift_m, 0.0, 500.0)})
        world.step()
    assert height(world, "beam") == pytest.approx(0.635, abs=0.005)


@pytest.mark.parametrize("engine", [PYBULLET])  # the other one computes every body in every step
def test_models_elsewhere_go_on_resting_when_a_model_comes_moves_and_goes(make_world: MakeWorld) -> None:
    world = make_world()
    for number in range(3):
        world.spawn(solid(f"cube_{number}", CUBE, Pose((number, 0, 0.025))))
    run(world, LONG_S)
    changed = "cube_0"
    world.set_state(changed, BodyState(Pose((0, 1, 0.025)), Twist()))
    world.spawn(solid("other", CUBE, Pose((0, 2, 0.025))))
    run(world, 0.5)
    assert world.moving() == {changed, "other"}
    world.delete("other")
    run(world, LONG_S)
    assert world.moving() == set()


def test_a_snapshot_follows_a_model_that_a_moving_one_woke(make_world: MakeWorld) -> None:
    world = make_world()
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.025))))
    run(world, LONG_S)
    world.spawn(solid("ball", specs.Sphere(0.05), Pose((-0.3, 0, 0.05)), mass=2.0))
    world.set_state("ball", BodyState(Pose((-0.3, 0, 0.05)), Twist((1.5, 0, 0))))
    shown, path, found = take_snapshot(world, ()), [], []
    for _ in range(25):
        run(world, 0.04)
        shown = take_snapshot(world, (), shown)
        path.append(world.entity_state("cube").pose)
        found.append(next(model for model in shown.models if model.name == "cube").links[0].pose_in_world)
    assert path[-1].position[0] > 0.05
    late = sum(1 for real, seen in zip(path, found, strict=True) if real != seen)
    assert late <= 3  # 0.1 s
    assert found[-1] == path[-1]


def test_the_referee_takes_no_hit_for_a_jump(make_world: MakeWorld) -> None:
    world = make_world()
    world.spawn(solid("block", specs.Box((0.1, 0.1, 0.15)), Pose((0, 0, 0.075))))
    world.spawn(solid("ball", specs.Sphere(0.05), Pose((-0.5, 0, 0.05)), mass=2.0))
    run(world, LONG_S)
    referee = Referee(world)
    world.set_state("ball", BodyState(Pose((-0.5, 0, 0.05)), Twist((6.0, 0, 0))))
    for _ in range(50):
        run(world, 0.02)
        referee.look_for_jumps()
    assert world.entity_state("block").pose.position[0] > 0.3
    assert referee.interventions == ()


def test_a_body_at_rest_that_is_set_in_motion_moves(make_world: MakeWorld) -> None:
    space = make_world(gravity=(0.0, 0.0, 0.0))
    space.spawn(solid("cube", CUBE, Pose((0, 0, 1))))
    run(space, LONG_S)
    space.set_state("cube", BodyState(Pose((0, 0, 1)), Twist((1.0, 0, 0), (0, 0, 2.0))))
    run(space, 0.5)
    state = space.entity_state("cube")
    assert state.pose.position[0] == pytest.approx(0.5, abs=0.003)
    assert state.twist.linear == pytest.approx((1.0, 0, 0), abs=1e-6)
    assert state.twist.angular == pytest.approx((0, 0, 2.0), abs=1e-6)


def test_a_body_at_rest_that_is_hit_takes_up_the_momentum(make_world: MakeWorld) -> None:
    space = make_world(gravity=(0.0, 0.0, 0.0))
    space.spawn(solid("cube", CUBE, Pose((0, 0, 1)), mass=0.2))
    run(space, LONG_S)
    space.spawn(solid("other", CUBE, Pose((-0.2, 0, 1)), mass=0.4))
    run(space, LONG_S)
    space.set_state("other", BodyState(Pose((-0.2, 0, 1)), Twist((0.5, 0, 0), (0, 0, 0))))
    run(space, 1.0)
    momentum = sum(mass * space.entity_state(name).twist.linear[0] for name, mass in (("cube", 0.2), ("other", 0.4)))
    assert space.entity_state("cube").twist.linear[0] > 0.3
    assert momentum == pytest.approx(0.2, rel=1e-3)


def test_a_force_on_a_body_at_rest_accelerates_it(make_world: MakeWorld) -> None:
    space = make_world(gravity=(0.0, 0.0, 0.0))
    space.spawn(solid("cube", CUBE, Pose((0, 0, 1)), mass=0.2))
    run(space, LONG_S)
    interval = Interval(space.time_ns, space.time_ns + 500_000_000)
    space.forces.add_wrench(LinkWrench(PartName("cube", "link"), (0.1, 0, 0), (0, 0, 0), interval))
    run(space, 1.0)
    assert space.entity_state("cube").twist.linear[0] == pytest.approx(0.1 * 0.5 / 0.2, rel=1e-3)


def test_a_body_at_rest_feels_another_gravity(table: PhysicsWorld) -> None:
    table.set_physics(table.settings, (0.0, 0.0, 2.0))
    run(table, 0.5)
    assert height(table) > 0.575 + 0.5 * 2.0 * 0.45**2


def test_a_slow_slip_that_begins_is_not_stopped(make_world: MakeWorld) -> None:
    tilted = make_world(gravity=(0.82 * GRAVITY, 0.0, -GRAVITY))  # friction 0.8: 0.2 m/s^2 are left
    tilted.spawn(solid("cube", CUBE, Pose((0, 0, 0.025))))
    run(tilted, LONG_S)
    assert tilted.entity_state("cube").twist.linear[0] > 0.3


def test_what_a_robot_carried_falls_when_the_robot_is_gone_at_once(
    make_world: MakeWorld, convex_parts: ConvexParts
) -> None:
    world = make_world()
    tray = RobotBody(world, read_robot(TRAY, str, convex_parts, False), "tray", Pose(), {})
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.5351))))

    def stand(lift_m: float, seconds: float) -> None:
        for _ in range(round(seconds / world.settings.time_step_s)):
            tray.read()
            tray.drive({"lift": Drive(Mode.POSITION, lift_m, 0.0, 500.0)})
            world.step()

    stand(0.0, LONG_S)
    assert height(world) == pytest.approx(0.535, abs=0.001)
    tray.body.set_joints({"lift": -0.4})
    stand(-0.4, 0.2)
    assert height(world) == pytest.approx(0.535 - 0.5 * GRAVITY * 0.2**2, abs=0.01)


class Lift:
    """A world with a tray that a controller holds, a cube on the floor and a wheel on an axle."""

    def __init__(self, world: PhysicsWorld, convex_parts: ConvexParts) -> None:
        self.world = world
        self.tray = RobotBody(world, read_robot(TRAY, str, convex_parts, False), "tray", Pose(), {})
        self.target_m = 0.0
        self.computed_steps = 0
        world.spawn(solid("cube", CUBE, Pose((1, 0, 0.025))))
        world.spawn(read_model_text(WHEEL, "text", Resources()))
        self._engine_step = world.engine.step

    def count_steps(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Counts the steps that the engine computes from now on."""

        def step() -> None:
            self.computed_steps += 1
            self._engine_step()

        monkeypatch.setattr(self.world.engine, "step", step)

    def run(self, seconds: float) -> None:
        """Lets time pass, with the controller on."""
        for _ in range(round(seconds / self.world.settings.time_step_s)):
            self.tray.read()
            self.tray.drive({"lift": Drive(Mode.POSITION, self.target_m, 0.0, 500.0)})
            self.world.step()

    def positions(self) -> tuple[float, ...]:
        """Height of the tray and of the cube, position of the cube, angle of the wheel."""
        wheel = self.world.body("wheel")
        cube = self.world.entity_state("cube").pose.position
        angle = self.world.engine.joint_states(wheel.number, [wheel.joint_indices["axle"]])[0].position
        return (self.world.entity_state("tray::plate").pose.position[2], *cube, angle)


@pytest.fixture
def lift(world: PhysicsWorld, convex_parts: ConvexParts, monkeypatch: pytest.MonkeyPatch) -> Lift:
    """A lift at rest."""
    made = Lift(world, convex_parts)
    made.run(LONG_S)
    made.count_steps(monkeypatch)
    return made


def test_steps_of_a_world_at_rest_are_not_computed(lift: Lift) -> None:
    before, time_ns, steps = lift.positions(), lift.world.time_ns, lift.world.steps
    lift.run(2.0)
    assert lift.computed_steps == 0
    assert lift.positions() == before
    assert lift.world.time_ns == time_ns + 2_000_000_000
    assert lift.world.steps == steps + 1000
    assert [reading.effort for reading in lift.tray.read()] == pytest.approx([GRAVITY], rel=1e-3)


def command(lift: Lift) -> None:
    lift.target_m = 0.1


def push(lift: Lift) -> None:
    begin = lift.world.time_ns + 200_000_000
    wrench = LinkWrench(PartName("cube", "link"), (5.0, 0, 0), (0, 0, 0), Interval(begin, begin + 100_000_000))
    lift.world.forces.add_wrench(wrench)


def turn(lift: Lift) -> None:
    lift.world.forces.add_effort(JointEffort(AXLE, 0.1, Interval(lift.world.time_ns, None)))


def start_motor(lift: Lift) -> None:
    set_joint(lift.world, AXLE, JointChange(None, None, JointSettings(None, 1.0, 5.0)))


def put_wheel(lift: Lift) -> None:
    set_joint_positions(lift.world, "wheel", {"axle": 0.5})


def throw(lift: Lift) -> None:
    lift.world.set_state("cube", BodyState(Pose((1, 0, 0.5)), Twist((0.2, 0, 0))))


def tilt(lift: Lift) -> None:
    lift.world.set_physics(lift.world.settings, (20.0, 0.0, -GRAVITY))


def hit(lift: Lift) -> None:
    lift.world.spawn(solid("ball", specs.Sphere(0.05), Pose((0.8, 0, 0.05)), mass=2.0))
    lift.world.set_state("ball", BodyState(Pose((0.8, 0, 0.05)), Twist((1.0, 0, 0))))


@pytest.mark.parametrize("action", [command, push, turn, start_motor, put_wheel, throw, tilt, hit])
def test_what_is_done_to_a_world_at_rest_moves_it(lift: Lift, action: Callable[[Lift], None]) -> None:
    lift.run(0.5)
    before = lift.positions()
    assert lift.computed_steps == 0
    action(lift)
    lift.run(1.0)
    assert lift.computed_steps > 50
    assert max(abs(a - b) for a, b in zip(lift.positions(), before, strict=True)) > 0.005


def test_a_state_saved_at_rest_continues_bit_for_bit(make_world: MakeWorld, convex_parts: ConvexParts) -> None:
    lift = Lift(make_world(rest_speed=0.0), convex_parts)
    lift.world.delete("cube")  # which trembles in PyBullet
    lift.run(LONG_S)
    assert lift.world.rest.holds
    saved, ends = lift.world.save_state(), []
    assert not lift.world.rest.holds  # as after `restore_state`
    for _ in range(2):
        lift.target_m = 0.0
        lift.run(0.4)
        lift.target_m = 0.1
        lift.run(0.4)
        ends.append((exact_state(lift.world), lift.tray.read()))
        lift.world.restore_state(saved)
    assert ends[0] == ends[1]


def test_an_effort_acts_on_when_a_force_elsewhere_is_due(world: PhysicsWorld, convex_parts: ConvexParts) -> None:
    text = TRAY.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics damping="0" friction="2"/>')
    tray = RobotBody(world, read_robot(text, str, convex_parts, False), "tray", Pose(), {})
    world.spawn(solid("cube", CUBE, Pose((1, 0, 0.025))))

    def hold(seconds: float) -> None:
        for _ in range(round(seconds / world.settings.time_step_s)):
            tray.read()
            tray.drive({"lift": Drive(Mode.EFFORT, GRAVITY, 0.0, 500.0)})
            world.step()

    hold(LONG_S)
    assert world.rest.holds
    before = world.entity_state("tray::plate").pose.position[2]
    begin = world.time_ns + 1_000_000_000
    wrench = LinkWrench(PartName("cube", "link"), (1.0, 0, 0), (0, 0, 0), Interval(begin, begin + 100_000_000))
    world.forces.add_wrench(wrench)
    hold(0.5)
    assert world.entity_state("tray::plate").pose.position[2] == pytest.approx(before, abs=1e-9)


def test_a_body_at_the_top_of_its_flight_is_not_taken_for_one_at_rest(make_world: MakeWorld) -> None:
    for steps in (49, 50, 51, 99, 100, 101):
        world = make_world()
        world.spawn(solid("cube", CUBE, Pose((0, 0, 1))))
        upwards = GRAVITY * world.settings.time_step_s * steps
        world.set_state("cube", BodyState(Pose((0, 0, 1)), Twist((0, 0, upwards))))
        run(world, 2 * steps * world.settings.time_step_s)
        assert world.entity_state("cube").twist.linear[2] == pytest.approx(-upwards, rel=0.02)


def test_the_state_of_a_world_with_bodies_at_rest_is_not_saved(table: PhysicsWorld, engine: str) -> None:
    if engine == PYBULLET:
        with pytest.raises(SimulationError, match="set rest_speed to 0"):
            table.save_state()
    else:
        table.save_state()
