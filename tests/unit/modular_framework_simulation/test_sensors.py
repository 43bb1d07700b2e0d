# SPDX-License-Identifier: BSD-3-Clause
"""Sensors measure what can be computed by hand: gravity, a spin, distances, weights; noise has the file's numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.urdf_model import read_urdf_model
from modular_framework_simulation.physics.body_links import measured_inertial
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.model_changes import set_inertial
from modular_framework_simulation.physics.part_names import PartName
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_simulation.sensors.cameras import CameraImage
from modular_framework_simulation.sensors.contact import ContactListener, ContactPair, ContactSensor
from modular_framework_simulation.sensors.force_torque import JointLoad
from modular_framework_simulation.sensors.imu import Imu, ImuReading, ImuSensor
from modular_framework_simulation.sensors.laser import Laser, LaserSensor
from modular_framework_simulation.sensors.noise import NO_NOISE, Noise, NoiseSource
from modular_framework_simulation.sensors.ray_scene import RayScene
from modular_framework_simulation.sensors.sensor_reader import Sensors, read_model_sensors
from modular_framework_testing.simulation.simulated_samples import run, solid

GRAVITY = 9.81
MASS = 2.0
SIZE = 0.2
BOX = f"<geometry><box><size>{SIZE} {SIZE} {SIZE}</size></box></geometry>"
MOMENT = MASS * SIZE**2 / 6
INERTIAL = f"""<inertial><mass>{MASS}</mass><inertia><ixx>{MOMENT}</ixx><iyy>{MOMENT}</iyy><izz>{MOMENT}</izz></inertia>
  </inertial>"""
IMU = """<sensor name="imu" type="imu"><update_rate>100</update_rate><pose>{pose}</pose>{noise}
  <plugin name="p" filename="libgazebo_ros_imu_sensor.so"><frameName>imu_frame</frameName>
  <updateRateHZ>50</updateRateHZ></plugin></sensor>"""
LASER = """<sensor name="scan" type="ray"><pose>{pose}</pose><update_rate>20</update_rate><visualize>1</visualize><ray>
  <scan><horizontal><samples>{samples}</samples><min_angle>{low}</min_angle><max_angle>{high}</max_angle></horizontal>
  </scan><range><min>0.1</min><max>8</max></range>{noise}</ray><plugin name="p" filename="libgazebo_ros_laser.so">
  <topicName>scan</topicName><frameName>laser</frameName></plugin></sensor>"""
BUMPER = """<sensor name="bump" type="contact"><contact><collision>{shape}</collision></contact>
  <plugin name="p" filename="libgazebo_ros_bumper.so"><bumperTopicName>bump</bumperTopicName>
  <frameName>{frame}</frameName></plugin></sensor>"""


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Sensors measure the same with every engine."""
    return str(request.param)


def model(sensors: str, name: str = "box", more: str = "", text: str = INERTIAL) -> specs.Model:
    """A box of 2 kg with sensors."""
    link = f'<link name="link">{text}<collision name="shape">{BOX}</collision>{sensors}</link>{more}'
    sdf = f'<sdf version="1.6"><model name="{name}">{link}</model></sdf>'
    return read_model_text(sdf, "text", Resources((), str))


def sensors_of(described: specs.Model) -> Sensors:
    """Its sensors, all of which can be used."""
    sensors = read_model_sensors(described, seed=1)
    assert not [fault for fault in sensors.faults.values() if "is not simulated" in fault]
    return sensors


def only(described: specs.Model) -> Any:
    """Its one sensor."""
    (sensor,) = sensors_of(described).found
    return sensor


def readings(world: PhysicsWorld, imu: Imu, count: int, steps: int = 5) -> list[ImuReading]:
    """What an IMU says every few steps."""
    found = []
    imu.measure()
    for _ in range(count):
        for _ in range(steps):
            world.step()
        reading = imu.measure()
        assert reading is not None
        found.append(reading)
    return found


def test_an_imu_at_rest_reads_gravity_upwards_in_its_own_frame(world: PhysicsWorld) -> None:
    described = model(IMU.format(pose="0 0 0 0.5 0.3 1.0", noise=""))
    world.spawn(replace(described, pose=Pose((0.0, 0.0, SIZE / 2))))
    for _ in range(250):
        world.step()
    sensor = only(described)
    reading = readings(world, Imu(world, sensor, 0), 5)[-1]
    up_in_sensor = np.array(trimesh.transformations.euler_matrix(0.5, 0.3, 1.0)[:3, :3]).T @ (0.0, 0.0, GRAVITY)
    assert reading.specific_force == pytest.approx(up_in_sensor, abs=0.01)
    assert reading.angular_velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    expected = trimesh.transformations.quaternion_from_euler(0.5, 0.3, 1.0)  # wxyz
    assert abs(np.dot(np.roll(expected, -1), reading.orientation)) == pytest.approx(1.0, abs=1e-6)


def test_an_imu_in_free_fall_reads_no_force(make_world: Callable[..., PhysicsWorld]) -> None:
    world = make_world()
    described = model(IMU.format(pose="0 0 0 0 0 0", noise=""))
    world.spawn(replace(described, pose=Pose((0.0, 0.0, 5.0))))
    reading = readings(world, Imu(world, only(described), 0), 10)[-1]
    assert reading.specific_force == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_an_imu_off_the_axis_of_a_spin_reads_the_spin_and_the_centripetal_acceleration(
    make_world: Callable[..., PhysicsWorld],
) -> None:
    world, rate, arm = make_world(1_000_000, (0.0, 0.0, 0.0)), 3.0, 0.5
    described = model(IMU.format(pose=f"{arm} 0 0 0 0 0", noise=""))
    world.spawn(replace(described, pose=Pose((0.0, 0.0, 5.0))))
    world.set_state("box", BodyState(Pose((0.0, 0.0, 5.0)), Twist(angular=(0.0, 0.0, rate))))
    reading = readings(world, Imu(world, only(described), 0), 20, steps=2)[-1]
    assert reading.angular_velocity == pytest.approx((0.0, 0.0, rate), rel=1e-4)
    assert reading.specific_force == pytest.approx((-(rate**2) * arm, 0.0, 0.0), abs=0.02)


def test_topic_frame_and_rate_of_an_imu_are_those_of_gazebos_plugin() -> None:
    imu = only(model(IMU.format(pose="0 0 0 0 0 0", noise="")))
    assert isinstance(imu, ImuSensor)
    assert (imu.topic, imu.frame_id, imu.rate_hz) == ("/box/imu_data", "imu_frame", 50.0)
    plugin = """<plugin name="imu" filename="libgazebo_ros_imu.so"><bodyName>link</bodyName><topicName>imu</topicName>
        <robotNamespace>/r</robotNamespace><updateRate>20</updateRate><gaussianNoise>0.1</gaussianNoise></plugin>"""
    old = only(model("", more=plugin))
    assert (old.topic, old.frame_id, old.rate_hz, old.parent) == ("/r/imu", "link", 20.0, "box::link")
    assert old.rate_noise == (Noise(stddev=0.1),) * 3


def laser_of(world: PhysicsWorld, sensor: LaserSensor, seed: int = 0) -> Laser:
    return Laser(world, sensor, RayScene(world, {}), seed)


def room(world: PhysicsWorld) -> None:
    """Puts a box, a ball and a can into a world."""
    shapes: tuple[tuple[specs.Geometry, tuple[float, float, float]], ...] = (
        (specs.Box((1.0, 0.4, 2.0)), (2.0, 0.3, 1.0)),
        (specs.Sphere(0.5), (0.5, 2.0, 1.0)),
        (specs.Cylinder(0.4, 2.0), (-1.5, -1.0, 1.0)),
    )
    for number, (geometry, position) in enumerate(shapes):
        world.spawn(solid(f"shape_{number}", geometry, Pose(position), static=True))


def to_circle(origin: np.ndarray, direction: np.ndarray, centre: tuple[float, float], radius: float) -> float:
    """Distance along a ray in a plane to a circle."""
    offset = origin - centre
    along, inside = offset @ direction, offset @ offset - radius**2
    root = along**2 - inside
    return float(-along - math.sqrt(root)) if root >= 0 and along < 0 else math.inf


def to_rectangle(origin: np.ndarray, direction: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Distance along a ray in a plane to a rectangle."""
    ends = np.sort([(low - origin) / direction, (high - origin) / direction], axis=0)
    enter, leave = ends[0].max(), ends[1].min()
    return float(enter) if 0 <= enter <= leave else math.inf


def test_a_laser_measures_distances_to_shapes_within_a_millimetre(world: PhysicsWorld) -> None:
    room(world)
    described = model(LASER.format(pose="0.05 0 0.4 0 0 0.2", samples=181, low=-3.0, high=3.0, noise=""))
    world.spawn(replace(described, pose=Pose((0.0, 0.0, 0.5)), static=True))
    ranges = laser_of(world, only(described)).measure()
    origin, height = np.array([0.05, 0.0]), 0.9
    expected = []
    for angle in np.linspace(-3.0, 3.0, 181) + 0.2:
        direction = np.array([math.cos(angle), math.sin(angle)])
        box = to_rectangle(origin, direction, np.array([1.5, 0.1]), np.array([2.5, 0.5]))
        ball = to_circle(origin, direction, (0.5, 2.0), math.sqrt(0.5**2 - (1.0 - height) ** 2))
        expected.append(min(box, ball, to_circle(origin, direction, (-1.5, -1.0), 0.4)))
    seen = np.isfinite(expected)
    assert 30 < seen.sum() < 150
    assert (np.isfinite(ranges) != seen).sum() <= 2  # a ray along an edge
    both = seen & np.isfinite(ranges)
    assert ranges[both] == pytest.approx(np.array(expected)[both], abs=1e-3)


def test_a_tilted_laser_measures_the_floor_past_what_is_nearer_than_its_least_range(world: PhysicsWorld) -> None:
    described = model(LASER.format(pose=f"0 0 1 0 {math.pi / 4} 0", samples=1, low=0, high=0, noise=""))
    world.spawn(replace(described, pose=Pose((0.0, 0.0, 0.5)), static=True))
    laser = laser_of(world, only(described))
    assert laser.measure() == pytest.approx([1.5 * math.sqrt(2)], abs=1e-4)
    near = specs.Collision("shape", Pose(), specs.Box((0.1, 0.1, 0.1)), specs.Friction())
    link = specs.Link("link", Pose(), None, (near,), ())
    world.spawn(specs.Model("lid", Pose((0.0, 0.0, 1.5)), True, (link,), (), "test"))
    assert laser.measure() == pytest.approx([1.5 * math.sqrt(2)], abs=1e-4)


def test_names_angles_and_ranges_of_a_laser_are_those_of_the_file_and_what_has_no_effect_is_listed() -> None:
    described = model(LASER.format(pose="0 0 0 0 0 0", samples=5, low=-1, high=1, noise=""))
    laser = only(described)
    assert isinstance(laser, LaserSensor)
    assert (laser.topic, laser.frame_id, laser.rate_hz) == ("scan", "laser", 20.0)
    assert (laser.min_range, laser.max_range, laser.angle_increment) == (0.1, 8.0, 0.5)
    assert laser.angles() == pytest.approx([-1.0, -0.5, 0.0, 0.5, 1.0])
    assert list(sensors_of(described).faults.values()) == [
        "text:2: <sensor name='scan'>: elements without effect: visualize"
    ]


def touched(world: PhysicsWorld, described: specs.Model) -> list[ContactPair]:
    """What the contact sensor of a model reports."""
    sensors = sensors_of(described)
    (sensor,) = sensors.found
    assert isinstance(sensor, ContactSensor)
    return ContactListener(world, sensor, sensors.parts.links).measure()


def settled(world: PhysicsWorld, described: specs.Model, pose: Pose) -> None:
    world.spawn(replace(described, pose=pose))
    for _ in range(500):
        world.step()


def test_a_bumper_names_both_shapes_and_weighs_a_box_within_a_percent(world: PhysicsWorld) -> None:
    described = model(BUMPER.format(shape="shape", frame="world"))
    settled(world, described, Pose((0.3, 0.0, SIZE / 2)))
    (pair,) = touched(world, described)
    assert (pair.own, pair.other) == ("box::link::shape", "floor::link::shape")
    assert sum(touch.force[2] for touch in pair.contacts) == pytest.approx(MASS * GRAVITY, rel=0.01)
    for touch in pair.contacts:
        assert touch.normal == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
        assert touch.position[2] == pytest.approx(0.0, abs=1e-3)
        assert abs(touch.depth) < 1e-3
    torque = np.sum([touch.torque for touch in pair.contacts], axis=0)
    assert torque == pytest.approx((0.0, 0.0, 0.0), abs=0.01 * MASS * GRAVITY * SIZE)


def test_friction_counts_on_a_slope_where_normal_and_friction_together_carry_the_weight(
    make_world: Callable[..., PhysicsWorld],
) -> None:
    tilt = 0.3
    world = make_world(gravity=(GRAVITY * math.sin(tilt), 0.0, -GRAVITY * math.cos(tilt)))
    described = model(BUMPER.format(shape="link::shape", frame="link"))
    settled(world, described, Pose((0.0, 0.0, SIZE / 2)))
    (pair,) = touched(world, described)
    force = np.sum([touch.force for touch in pair.contacts], axis=0)
    assert force == pytest.approx(-MASS * np.array(world.gravity), abs=0.01 * MASS * GRAVITY)


def test_a_bumper_of_what_stands_still_feels_the_weight_downwards(world: PhysicsWorld) -> None:
    plate = model(BUMPER.format(shape="shape", frame="world"), name="plate")
    world.spawn(replace(plate, static=True))
    box = model("", name="load")
    settled(world, box, Pose((0.0, 0.0, SIZE)))
    (pair,) = [each for each in touched(world, replace(plate, static=True)) if each.other.startswith("load")]
    assert pair.own == "plate::link::shape"
    force = np.sum([touch.force for touch in pair.contacts], axis=0)
    assert force == pytest.approx((0.0, 0.0, -MASS * GRAVITY), abs=0.01 * MASS * GRAVITY)
    assert pair.contacts[0].normal == pytest.approx((0.0, 0.0, -1.0), abs=1e-4)


def test_of_several_shapes_of_a_link_the_one_that_touches_is_named(world: PhysicsWorld) -> None:
    foot = """<collision name="foot"><pose>0.3 0 -0.15 0 0 0</pose><geometry><sphere><radius>0.05</radius></sphere>
        </geometry></collision><collision name="other_foot"><pose>-0.3 0 -0.15 0 0 0</pose><geometry><cylinder>
        <radius>0.1</radius><length>0.1</length></cylinder></geometry></collision>"""
    described = model(foot + BUMPER.format(shape="foot", frame="world"))
    settled(world, described, Pose((0.0, 0.0, 0.2)))
    (pair,) = touched(world, described)
    assert pair.own == "box::link::foot"
    assert pair.contacts[0].position[0] == pytest.approx(0.3, abs=0.01)
    every = sum(point.force[2] for point in world.contact_points("box", "link"))
    assert 0.0 < sum(touch.force[2] for touch in pair.contacts) < 0.9 * every


@pytest.mark.parametrize(
    ("sensor", "found"),
    [
        ("<sensor name='s' type='gps'/>", "text:2: <sensor name='s'>: got type 'gps'; allowed: camera, depth"),
        (BUMPER.format(shape="wheel", frame="world"), "<contact/collision>: got 'wheel'; allowed: shape"),
        (BUMPER.format(shape="shape", frame="moon"), "<frameName>: got 'moon'; allowed: world, or a link"),
        (LASER.format(pose="0 0", samples=1, low=0, high=0, noise=""), "<pose>: got '0 0'; expected six numbers"),
        (LASER.format(pose="", samples=0, low=0, high=0, noise=""), "<ray/scan/horizontal/samples>: got 0; allowed: 1"),
        (LASER.format(pose="", samples=1, low=1, high=0, noise=""), "max_angle>: got 0 rad; allowed: 1 (min_angle)"),
        (IMU.format(pose="", noise="").replace("<frameName>imu_frame</frameName>", ""), "<frameName>: is empty"),
        ("<sensor name='s' type='imu'/>", "has no topic; add a <plugin> (gazebo_ros_imu_sensor"),
        (IMU.format(pose="", noise="").replace("_imu_sensor.so", "_gps.so"), "got the plugin 'libgazebo_ros_gps.so'"),
        (
            LASER.format(pose="", samples=1, low=0, high=0, noise="<noise type='odd'/>"),
            "<ray/noise>: got type 'odd'; allowed: none, gaussian",
        ),
    ],
)
def test_a_sensor_that_cannot_be_used_is_named_with_what_is_allowed(sensor: str, found: str) -> None:
    sensors = read_model_sensors(model(sensor))
    assert sensors.found == []
    assert len(sensors.faults) == 1
    assert found in next(iter(sensors.faults.values()))


def test_an_unknown_plugin_of_a_model_is_named_once_and_that_of_the_controllers_is_known() -> None:
    plugins = """<plugin name="a" filename="libwheels.so"/><plugin name="b" filename="libwheels.so"/>
        <plugin name="c" filename="libgazebo_ros_control.so"/>"""
    faults = list(read_model_sensors(model("", more=plugins)).faults.values())
    assert len(faults) == 1
    assert "got the plugin 'libwheels.so'; allowed for a model: libgazebo_ros_imu.so" in faults[0]


def test_a_sensor_of_an_inner_model_is_in_its_link() -> None:
    imu = IMU.format(pose="0 0 1 0 0 0", noise="")
    inner = f'<model name="inner"><link name="head">{INERTIAL}{imu}</link></model>'
    sensor = only(model("", more=inner))
    assert (sensor.name, sensor.parent, sensor.pose.position) == (
        "box::inner::head::imu",
        "box::inner::head",
        (0, 0, 1),
    )


def test_noise_has_the_mean_the_deviation_and_the_bias_of_the_file() -> None:
    source = NoiseSource(7, "sensor", (Noise(0.5, 0.2, 3.0, 0.0), NO_NOISE))
    assert abs(source.biases[0]) == 3.0
    noisy = np.array([source.add_noise(np.array([1.0, 2.0]), time_ns) for time_ns in range(0, 20_000_000, 1_000)])
    shifted = noisy[:, 0] - source.biases[0]
    standard_error = 0.2 / math.sqrt(len(shifted))
    assert shifted.mean() == pytest.approx(1.5, abs=4 * standard_error)
    assert shifted.std() == pytest.approx(0.2, rel=4 / math.sqrt(2 * len(shifted)))
    assert (noisy[:, 1] == 2.0).all()
    biases = np.array([NoiseSource(seed, "s", (Noise(0, 0, 1.0, 0.1),)).biases[0] for seed in range(2_000)])
    assert np.abs(biases).mean() == pytest.approx(1.0, abs=4 * 0.1 / math.sqrt(2_000))
    assert (biases > 0).mean() == pytest.approx(0.5, abs=4 * 0.5 / math.sqrt(2_000))


def test_quantized_noise_gives_multiples_of_its_precision() -> None:
    noisy = NoiseSource(1, "s", (Noise(stddev=1.0, precision=0.25),)).add_noise(np.zeros((1, 100)), 5)
    assert noisy / 0.25 == pytest.approx(np.rint(noisy / 0.25))
    assert len(set(noisy[0])) > 3


def test_the_same_seed_gives_the_same_bits_at_the_same_time_and_another_sensor_or_seed_gives_others() -> None:
    def drawn(seed: int, sensor: str, time_ns: int) -> bytes:
        source = NoiseSource(seed, sensor, (Noise(stddev=1.0),))
        return source.add_noise(np.zeros((1, 8)), time_ns).tobytes()

    assert drawn(3, "a", 1_000) == drawn(3, "a", 1_000)
    assert len({drawn(3, "a", 1_000), drawn(3, "a", 2_000), drawn(3, "b", 1_000), drawn(4, "a", 1_000)}) == 4


def test_a_noisy_imu_and_a_noisy_laser_repeat_bit_for_bit_after_a_restart(world: PhysicsWorld) -> None:
    noise = "<noise type='gaussian'><mean>0</mean><stddev>0.05</stddev></noise>"
    axes = "".join(f"<{axis}>{noise}</{axis}>" for axis in "xyz")
    kinds = f"<imu><angular_velocity>{axes}</angular_velocity><linear_acceleration>{axes}</linear_acceleration></imu>"
    laser = LASER.format(pose="0 0 0.5 0 0.3 0", samples=30, low=-1, high=1, noise=noise)
    described = replace(model(IMU.format(pose="0 0 0 0 0 0", noise=kinds) + laser), pose=Pose((0.0, 0.0, 1.0)))
    world.spawn(described, keep=True)
    world.spawn(solid("ground", specs.Plane((0, 0, 1), (10, 10)), Pose(), static=True), keep=True)
    world.restart()

    def run() -> tuple[list[ImuReading], bytes]:
        found = {type(sensor): sensor for sensor in sensors_of(described).found}
        imu, scan = Imu(world, found[ImuSensor], 1), laser_of(world, found[LaserSensor], 1)
        return readings(world, imu, 10), scan.measure().tobytes()

    first = run()
    world.restart()
    assert run() == first
    forces = np.array([reading.specific_force for reading in first[0]])
    assert 0.02 < forces.std() < 0.1


def test_looking_changes_nothing_in_the_world(make_world: Callable[..., PhysicsWorld], tmp_path: Path) -> None:
    described = model(
        LASER.format(pose="0 0 0.5 0 0.3 0", samples=30, low=-1, high=1, noise="")
        + BUMPER.format(shape="shape", frame="world")
        + IMU.format(pose="0 0 0 0 0 0", noise="")
    )

    def fall(looking: bool) -> BodyState:
        world = make_world()
        world.spawn(replace(described, pose=Pose.from_xyz_rpy((0.0, 0.0, 0.4), (0.3, 0.4, 0.5))))
        sensors = sensors_of(described)
        laser, bumper, imu = sensors.found
        instruments: list[Any] = [
            laser_of(world, laser), ContactListener(world, bumper, sensors.parts.links), Imu(world, imu, 0),
        ]  # fmt: skip
        for _ in range(400):
            world.step()
            for instrument in instruments if looking else ():
                instrument.measure()
        return world.body("box").state()

    assert fall(looking=True) == fall(looking=False)


def test_a_laser_follows_what_moves_and_what_comes_and_goes_and_sees_meshes(
    world: PhysicsWorld, tmp_path: Path
) -> None:
    scanner = model(LASER.format(pose="0 0 0.5 0 0 0", samples=1, low=0, high=0, noise=""), name="scanner")
    world.spawn(replace(scanner, static=True))
    laser = laser_of(world, only(scanner))
    assert laser.measure() == pytest.approx([math.inf])
    world.spawn(solid("wall", specs.Box((0.2, 1.0, 2.0)), Pose((2.1, 0.0, 1.0))))
    assert laser.measure() == pytest.approx([2.0], abs=1e-6)
    world.set_state("wall", BodyState(Pose((3.1, 0.0, 1.0)), Twist()))
    assert laser.measure() == pytest.approx([3.0], abs=1e-6)
    world.delete("wall")
    assert laser.measure() == pytest.approx([math.inf])
    trimesh.creation.box((0.2, 1.0, 2.0)).export(tmp_path / "wall.obj")
    world.spawn(solid("mesh", specs.Mesh(tmp_path / "wall.obj", (2.0, 1.0, 1.0)), Pose((2.2, 0.0, 1.0)), static=True))
    assert laser.measure() == pytest.approx([2.0], abs=1e-6)


@pytest.mark.parametrize(
    ("settings", "turn", "sign"),
    [
        ("", "child", 1),
        ("<frame>parent</frame>", "parent", 1),
        ("<frame>sensor</frame>", "sensor", 1),
        ("<measure_direction>parent_to_child</measure_direction>", "child", -1),
    ],
)
def test_a_force_torque_sensor_of_a_model_weighs_the_child_in_the_axes_it_names(
    world: PhysicsWorld, settings: str, turn: str, sign: int
) -> None:
    text = f"""<sdf version="1.6"><model name="arm"><link name="a">{INERTIAL}</link><link name="b">
        <pose>0 0 0.5 0.4 0 0</pose>{INERTIAL}</link><joint name="root" type="fixed"><parent>world</parent>
        <child>a</child></joint><joint name="j" type="fixed"><pose>0.1 0 0 0 0.7 0</pose><parent>a</parent>
        <child>b</child><sensor name="load" type="force_torque"><pose>0 0 0 0 0 0.5</pose><topic>load</topic>
        <force_torque>{settings}</force_torque></sensor></joint></model></sdf>"""
    described = replace(
        read_model_text(text, "text", Resources((), str)), pose=Pose.from_xyz_rpy((0.0, 0.0, 1.0), (0.0, 0.2, 0.0))
    )
    world.spawn(described)
    load = JointLoad(world, only(described))
    assert load.measure() is None
    for _ in range(100):
        world.step()
    wrench = load.measure()
    assert wrench is not None
    parent, child_in_parent, sensor_in_child = (
        trimesh.transformations.euler_matrix(*rpy)[:3, :3]
        for rpy in ((0.0, 0.2, 0.0), (0.4, 0.0, 0.0), (0.0, 0.0, 0.5))
    )
    child = parent @ child_in_parent
    axes = {"parent": parent, "child": child, "sensor": child @ sensor_in_child}[turn]
    weight = np.array([0.0, 0.0, -MASS * GRAVITY])
    centre_from_joint = child @ (-0.1, 0.0, 0.0)
    assert wrench.force == pytest.approx(sign * axes.T @ weight, abs=0.01 * MASS * GRAVITY)
    assert wrench.torque == pytest.approx(sign * axes.T @ np.cross(centre_from_joint, weight), abs=0.02)


def test_a_force_torque_sensor_weighs_on_when_a_mass_is_changed(world: PhysicsWorld) -> None:
    text = f"""<sdf version="1.6"><model name="arm"><link name="a">{INERTIAL}</link><link name="b">{INERTIAL}</link>
        <joint name="root" type="fixed"><parent>world</parent><child>a</child></joint>
        <joint name="j" type="fixed"><parent>a</parent><child>b</child>
        <sensor name="load" type="force_torque"><topic>load</topic></sensor></joint>
        </model></sdf>"""
    described = replace(read_model_text(text, "text", Resources((), str)), pose=Pose((0.0, 0.0, 1.0)))
    world.spawn(described)
    load = JointLoad(world, only(described))
    load.measure()
    run(world, 0.1)
    present = measured_inertial(world.engine, world.body("arm"), "b")
    assert set_inertial(world, PartName("arm", "b"), replace(present, mass=2 * MASS))
    assert load.measure() is None
    run(world, 0.1)
    wrench = load.measure()
    assert wrench is not None
    assert wrench.force == pytest.approx((0.0, 0.0, -2 * MASS * GRAVITY), abs=0.01 * MASS * GRAVITY)


def test_noise_of_a_camera_has_the_deviation_of_the_file_on_its_colours() -> None:
    grey = CameraImage(np.full((100, 100, 3), 128, np.uint8), np.ones((100, 100), np.float32))
    noisy = grey.with_noise(NoiseSource(5, "camera", (Noise(stddev=0.05),)), 7)
    assert noisy.rgb.std() == pytest.approx(0.05 * 255, rel=0.02)
    assert noisy.rgb.mean() == pytest.approx(128, abs=0.5)
    assert grey.with_noise(NoiseSource(5, "camera", (NO_NOISE,)), 7) is grey


def test_sensors_of_a_urdf_are_in_the_links_they_refer_to_and_below_the_namespace_it_is_spawned_with() -> None:
    text = f"""<robot name="toy"><link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/>
        </inertial>
        <collision><geometry><box size="1 1 1"/></geometry></collision></link><gazebo reference="base">
        {BUMPER.format(shape="base_collision", frame="base")}
        {IMU.format(pose="0 0 1 0 0 0", noise="")}</gazebo></robot>"""
    described = replace(read_urdf_model(text, "text", Resources((), str)), namespace="/toys")
    bumper, imu = sensors_of(described).found
    assert isinstance(bumper, ContactSensor)
    assert (bumper.topic, bumper.collisions, bumper.reference_link) == ("/toys/bump", ("base_collision",), "base")
    assert isinstance(imu, ImuSensor)
    assert (imu.topic, imu.parent, imu.pose.position) == ("/toys/imu_data", "toy::base", (0.0, 0.0, 1.0))
