# SPDX-License-Identifier: BSD-3-Clause
"""Models obey physics, requests and reset, and the same commands give the same world."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import trimesh

from modular_framework_simulation.errors import DescriptionError, DuplicateModelError, UnknownEntityError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.urdf_model import read_urdf_model
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_testing.simulation.simulated_samples import exact_state, run, solid

CUBE = specs.Box((0.05, 0.05, 0.05))


def test_a_box_falls_as_newton_says_and_comes_to_rest_on_the_floor(world: PhysicsWorld) -> None:
    body = world.spawn(solid("cube", CUBE, Pose((0, 0, 1.025))))
    run(world, 0.4)
    assert body.state().pose.position[2] == pytest.approx(1.025 - 9.81 * 0.4**2 / 2, abs=0.01)
    assert body.state().twist.linear[2] == pytest.approx(-9.81 * 0.4, rel=0.01)
    run(world, 1.6)
    assert body.state().pose.position[2] == pytest.approx(0.025, abs=0.001)
    assert math.dist(body.state().twist.linear, (0, 0, 0)) < 0.01


@pytest.mark.parametrize(
    ("geometry", "height"),
    [(CUBE, 0.05), (specs.Cylinder(0.03, 0.1), 0.1), (specs.Sphere(0.03), 0.06)],
)
def test_an_object_rests_where_its_shape_ends_and_stays_there(
    world: PhysicsWorld, geometry: specs.Geometry, height: float
) -> None:
    world.spawn(solid("table", specs.Box((1, 1, 0.1)), Pose((0, 0, 0.45)), static=True))
    body = world.spawn(solid("thing", geometry, Pose((0.1, 0, 0.5 + height / 2))))
    run(world, 0.5)
    before = body.state().pose
    assert before.position[2] == pytest.approx(0.5 + height / 2, abs=1e-4)
    run(world, 4.0)
    assert before.distance_to(body.state().pose)[0] < 1e-4


def test_a_box_slides_on_a_steep_slope_and_sticks_on_a_shallow_one(world: PhysicsWorld) -> None:
    moved = {}
    for name, angle, y in (("shallow", 0.3, 0.0), ("steep", 0.9, 2.0)):
        slope = Pose.from_xyz_rpy((0, y, 0.5), (0, angle, 0))
        world.spawn(solid(f"{name}_slope", specs.Box((0.6, 0.4, 0.02)), slope, static=True))
        body = world.spawn(solid(name, CUBE, slope @ Pose((0, 0, 0.0355))))
        start = body.state().pose
        run(world, 0.3)
        moved[name] = start.distance_to(body.state().pose)[0]
    assert moved["shallow"] < 0.002
    assert moved["steep"] > 0.02


@pytest.mark.parametrize(("rolling", "speed"), [(1e-4, 0.0), (None, 0.05)])
def test_a_ball_comes_to_rest_if_its_surface_resists_rolling(
    world: PhysicsWorld, rolling: float | None, speed: float
) -> None:
    shape = specs.Sphere(0.03)
    surface = specs.Collision("shape", Pose(), shape, specs.Friction(0.8, rolling=rolling))
    body = world.spawn(solid("ball", shape, Pose((0, 0, 0.03)), surface=surface))
    world.set_state("ball", BodyState(Pose((0, 0, 0.03)), Twist((0.05, 0, 0), (0, 0.05 / 0.03, 0))))
    run(world, 5.0)
    assert math.dist(body.state().twist.linear, (0, 0, 0)) == pytest.approx(speed, abs=0.005)


def test_the_model_frame_is_not_the_centre_of_mass(world: PhysicsWorld) -> None:
    text = """<sdf version='1.6'><model name='m'><link name='a'><pose>0.1 0 0 0 0 0.5</pose><inertial><mass>1</mass>
        <pose>0 0.2 0 0 0 0</pose><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>
        <collision name='c'><geometry><box><size>0.5 0.5 0.1</size></box></geometry></collision></link></model></sdf>"""
    model = read_model_text(text, "text", Resources())
    body = world.spawn(model)
    wanted = Pose.from_xyz_rpy((1, 2, 3), (0.1, 0.2, 0.3))
    world.set_state("m", BodyState(wanted, Twist((0.3, 0, 0), (0, 0, 1.0))))
    assert body.state().pose.distance_to(wanted)[0] < 1e-9
    assert body.state().twist.linear == pytest.approx((0.3, 0, 0))
    link = world.entity_state("m::a")
    assert link.pose.distance_to(wanted @ model.links[0].pose)[0] < 1e-9
    lever = [a - b for a, b in zip(link.pose.position, wanted.position, strict=True)]
    assert link.twist.linear == pytest.approx((0.3 - lever[1], lever[0], 0))


def test_a_twist_in_a_reference_frame_is_turned_into_the_axes_of_the_world(world: PhysicsWorld) -> None:
    """As in gazebo_ros: the motion of the reference is not added, so that a model can be stopped in its own frame."""
    body = world.spawn(solid("cart", CUBE, Pose((0, 0, 1))))
    turned = Pose.from_xyz_rpy((1, 0, 1), (0, 0, math.pi / 2))
    world.set_state("cart", BodyState(turned, Twist((0.5, 0, 0), (0, 0, 2.0))))
    world.set_state("cart", BodyState(Pose(), Twist((0.3, 0, 0), (0, 0.1, 0))), "cart")
    assert body.state().pose.distance_to(turned)[0] < 1e-9
    assert body.state().twist.linear == pytest.approx((0, 0.3, 0), abs=1e-9)
    assert body.state().twist.angular == pytest.approx((-0.1, 0, 0), abs=1e-9)
    for _ in range(50):
        world.set_state("cart", BodyState(Pose(), Twist()), "cart")
    assert body.state().pose.distance_to(turned)[0] < 1e-9
    assert body.state().twist.linear == pytest.approx((0, 0, 0), abs=1e-9)


def test_a_static_model_carries_all_its_links_and_never_moves(world: PhysicsWorld) -> None:
    text = """<sdf version='1.6'><model name='table'><static>true</static>
        <link name='top'><pose>0 0 0.5 0 0 0</pose><collision name='c'><geometry><box><size>1 1 0.04</size></box>
        </geometry></collision></link>
        <link name='leg'><pose>0 0 0.24 0 0 0</pose><collision name='c'><geometry><box><size>.1 .1 .48</size></box>
        </geometry></collision></link></model></sdf>"""
    world.spawn(read_model_text(text, "text", Resources()))
    cube = world.spawn(solid("cube", CUBE, Pose((0.3, 0.3, 0.6))))
    run(world, 1.0)
    assert cube.state().pose.position[2] == pytest.approx(0.545, abs=0.001)
    assert world.entity_state("table::leg").pose.position == pytest.approx((0, 0, 0.24))


def test_the_links_of_a_jointed_model_are_where_the_file_puts_them_and_swing(world: PhysicsWorld) -> None:
    inertial = "<inertial><mass>0.5</mass><inertia><ixx>.001</ixx><iyy>.001</iyy><izz>.001</izz></inertia></inertial>"
    text = f"""<sdf version='1.6'><model name='door'><link name='post'>{inertial}</link>
        <link name='leaf'><pose>0.4 0 1 0 0 0</pose>{inertial}</link>
        <joint name='fast' type='fixed'><parent>world</parent><child>post</child></joint>
        <joint name='hinge' type='revolute'><pose>-0.4 0 0 0 0 0</pose><parent>post</parent><child>leaf</child>
        <axis><xyz>0 1 0</xyz><limit><lower>-3</lower><upper>3</upper></limit></axis></joint></model></sdf>"""
    world.spawn(read_model_text(text, "text", Resources()))
    assert world.entity_state("door::leaf").pose.position == pytest.approx((0.4, 0, 1.0))
    run(world, 0.2)
    swung = world.entity_state("door::leaf").pose.position
    assert math.dist(swung, (0, 0, 1)) == pytest.approx(0.4, abs=0.01)
    assert swung[2] < 0.95


def test_a_hollow_mesh_stays_hollow(world: PhysicsWorld, tmp_path: Path) -> None:
    file = tmp_path / "ring.stl"
    trimesh.creation.annulus(r_min=0.04, r_max=0.06, height=0.04, sections=24).export(file)
    world.spawn(solid("ring", specs.Mesh(file), Pose((0, 0, 0.02)), mass=1.0))
    ball = world.spawn(solid("ball", specs.Sphere(0.015), Pose((0, 0, 0.1)), mass=0.02))
    run(world, 1.0)
    assert ball.state().pose.position[2] == pytest.approx(0.015, abs=0.002)


def test_states_are_given_relative_to_models_and_links(world: PhysicsWorld) -> None:
    frame = Pose.from_xyz_rpy((1, 0, 0), (0, 0, math.pi / 2))
    world.spawn(solid("base", CUBE, frame, static=True))
    world.spawn(solid("cube", CUBE, Pose((1, 2, 0.5))))
    assert world.state_relative_to("cube", "base").pose.position == pytest.approx((2, 0, 0.5))
    assert world.state_relative_to("cube", "base::link").pose.position == pytest.approx((2, 0, 0.5))
    assert world.state_relative_to("cube", "world").pose.position == pytest.approx((1, 2, 0.5))
    world.set_state("cube", BodyState(Pose((1, 0, 0)), Twist((1, 0, 0))), "base")
    state = world.entity_state("cube")
    assert state.pose.position == pytest.approx((1, 1, 0))
    assert state.twist.linear == pytest.approx((0, 1, 0))


def test_unknown_and_taken_names_are_refused_with_what_there_is(world: PhysicsWorld) -> None:
    world.spawn(solid("cube", CUBE, Pose((0, 0, 1))))
    with pytest.raises(DuplicateModelError, match="'cube' is already"):
        world.spawn(solid("cube", CUBE, Pose()))
    with pytest.raises(UnknownEntityError, match="no model 'mug'.*known: cube, floor"):
        world.delete("mug")
    with pytest.raises(UnknownEntityError, match="no link 'cube::lid'.*known: cube::link"):
        world.entity_state("cube::lid")
    with pytest.raises(UnknownEntityError, match="no model 'nowhere'"):
        world.state_relative_to("cube", "nowhere")


def test_a_deleted_model_is_gone_and_its_name_free(world: PhysicsWorld) -> None:
    world.spawn(solid("cube", CUBE, Pose((0, 0, 1))))
    world.delete("cube")
    assert world.names() == ["floor"]
    assert world.spawn(solid("cube", CUBE, Pose((0, 0, 2)))).state().pose.position[2] == pytest.approx(2)


def test_reset_puts_models_back_at_rest(world: PhysicsWorld) -> None:
    body = world.spawn(solid("cube", CUBE, Pose((0, 0, 1))))
    run(world, 0.2)
    world.reset_poses()
    assert body.state() == BodyState(Pose((0, 0, 1)), Twist())
    assert world.time_ns == 200_000_000
    world.reset_time()
    assert world.time_ns == 0


def test_two_worlds_stepped_alike_are_equal_bit_for_bit(make_world: Callable[[], PhysicsWorld]) -> None:
    prints = []
    for _ in range(2):
        world = make_world()
        for number in range(4):
            pose = Pose.from_xyz_rpy((0.01 * number, 0, 0.1 + 0.06 * number), (0.1, 0.2, 0.3))
            world.spawn(solid(f"cube_{number}", CUBE, pose))
        run(world, 0.5)
        world.set_state("cube_0", BodyState(Pose((0.1, 0, 0.3)), Twist()))
        run(world, 0.5)
        prints.append(exact_state(world))
    assert prints[0] == prints[1]
    world.step()
    assert exact_state(world) != prints[1]


def test_an_object_in_urdf_is_read_with_weight_and_friction(world: PhysicsWorld) -> None:
    text = """<robot name='r'><link name='body'><inertial><mass value='0.3'/><inertia ixx='0.001' iyy='0.001'
        izz='0.001' ixy='0' ixz='0' iyz='0'/></inertial><collision><geometry><box size='0.1 0.1 0.1'/></geometry>
        </collision></link><link name='knob'/><joint name='j' type='fixed'><parent link='body'/><child link='knob'/>
        <origin xyz='0 0 0.1'/></joint><gazebo reference='body'><mu1>0.3</mu1></gazebo></robot>"""
    model = read_urdf_model(text, "text", Resources())
    assert model.links[0].collisions[0].friction.lateral == 0.3
    assert model.links[1].pose.position == (0, 0, 0.1)
    world.spawn(replace(model, pose=Pose((0, 0, 0.052))))
    run(world, 0.3)
    assert world.entity_state("r").pose.position[2] == pytest.approx(0.05, abs=0.002)


@pytest.mark.parametrize(
    ("inside", "fault"),
    [
        ("<joint name='t' type='continuous'><parent link='a'/><child link='b'/><mimic joint='t'/></joint>", "t -> t"),
        ("<xacro:include filename='x'/>", "is xacro"),
        ("<link name='c'><xacro:body/></link>", "body>: is xacro"),
        ("<gazebo><plugin name='p' filename='f'><xacro:gains/></plugin></gazebo>", "gains>: is xacro"),
    ],
)
def test_an_object_in_urdf_that_defines_itself_or_is_not_expanded_is_refused(inside: str, fault: str) -> None:
    text = (
        f"<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'><link name='a'/><link name='b'/>{inside}</robot>"
    )
    with pytest.raises(DescriptionError, match=fault):
        read_urdf_model(text, "text", Resources())


LONG = "n" * 1024
LINK = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>"


def two_links(robot: str = "r", link: str = "a", joint: str = "j") -> str:
    """An object whose names are given."""
    return (
        f"<robot name='{robot}'><link name='{link}'>{LINK}<link name='b'>{LINK}<joint name='{joint}' type='fixed'>"
        f"<parent link='{link}'/><child link='b'/></joint></robot>"
    )


@pytest.mark.parametrize("part", ["robot", "link", "joint"])
def test_a_name_the_engine_has_no_room_for_is_refused(world: PhysicsWorld, part: str) -> None:
    model = read_urdf_model(two_links(**{part: LONG}), "text", Resources())
    with pytest.raises(DescriptionError, match=rf"<{part} name='n+\.\.\.'>: is 1,024 bytes long; .* at most 1,023"):
        world.spawn(model)
    accented = "\N{LATIN SMALL LETTER E WITH ACUTE}" * 600
    with pytest.raises(DescriptionError, match="is 1,200 bytes long"):
        world.spawn(read_urdf_model(two_links(**{part: accented}), "text", Resources()))
    longest = read_urdf_model(two_links(**{part: LONG[1:]}), "text", Resources())
    assert world.spawn(longest).name == longest.name
    run(world, 0.01)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("<link name='a'><collision><geometry><box size='1 1'/></geometry></collision></link>", "expected 3"),
        ("<link name='a'><collision><geometry><torus/></geometry></collision></link>", "allowed: one of box"),
        ("", "has no <link>"),
        ("<link name='a'/><joint name='j' type='ball'><parent link='a'/><child link='b'/></joint>", "'ball'"),
        (
            "<link name='a'/><joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint>",
            "'b' is not a link",
        ),
    ],
)
def test_a_fault_in_an_urdf_object_is_pointed_at(body: str, said: str) -> None:
    with pytest.raises(DescriptionError, match=said):
        read_urdf_model(f"<robot name='r'>{body}</robot>", "text", Resources())
