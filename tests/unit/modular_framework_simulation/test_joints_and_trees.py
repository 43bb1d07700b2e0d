# SPDX-License-Identifier: BSD-3-Clause
"""Joints lead where their file says, whichever way round it names their ends; loose links are bodies of their own."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from modular_framework_simulation.errors import DescriptionError, UnknownEntityError
from modular_framework_simulation.models.joint_trees import joint_trees
from modular_framework_simulation.models.model_links import link_poses
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_specs import Model
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist

INERTIAL = "<inertial><mass>1</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia></inertial>"


def link(name: str, x: float = 0.0, z: float = 1.0) -> str:
    return f"<link name='{name}'><pose>{x} 0 {z} 0 0 0</pose>{INERTIAL}</link>"


def joint(parent: str, child: str, name: str = "j", kind: str = "revolute", pose: str = "0 0 0 0 0 0") -> str:
    return (
        f"<joint name='{name}' type='{kind}'><pose>{pose}</pose><parent>{parent}</parent><child>{child}</child>"
        "<axis><xyz>0 1 0</xyz></axis></joint>"
    )


def model(body: str, name: str = "m") -> Model:
    return read_model_text(f"<sdf version='1.6'><model name='{name}'>{body}</model></sdf>", "text", Resources())


@pytest.mark.parametrize("kind", ["revolute", "ball"])
def test_a_joint_to_the_world_that_moves_is_a_pendulum(world: PhysicsWorld, kind: str) -> None:
    world.spawn(model(link("bob", x=0.5, z=2.0) + joint("world", "bob", kind=kind, pose="-0.5 0 0 0 0 0")))
    lowest = 2.0
    for _ in range(300):
        world.step()
        x, y, z = world.entity_state("m::bob").pose.position
        assert math.hypot(x, z - 2.0) == pytest.approx(0.5, abs=1e-3)
        lowest = min(lowest, z)
    assert lowest == pytest.approx(1.5, abs=0.01)


def test_a_joint_to_the_world_that_does_not_move_holds_its_link(world: PhysicsWorld) -> None:
    world.spawn(model(link("a") + joint("world", "a", kind="fixed")))
    world.spawn(model(link("a", x=1.0) + joint("a", "world", kind="fixed"), "other"))
    for _ in range(100):
        world.step()
    assert world.entity_state("m::a").pose.position == pytest.approx((0, 0, 1))
    assert world.entity_state("other::a").pose.position == pytest.approx((1, 0, 1))


def test_a_link_with_two_parents_hangs_on_one_and_carries_the_other() -> None:
    tree = joint_trees(model(link("a") + link("b", x=1) + link("c", x=2) + joint("a", "c") + joint("b", "c", "k")))[0]
    assert [(j.name, j.parent, j.child, j.axis) for j in tree.joints] == [
        ("j", "a", "c", (0, 1, 0)),
        ("k", "c", "b", (0, -1, 0)),
    ]
    assert tree.joints[1].pose == Pose((1, 0, 0))


@pytest.mark.parametrize("ends", [("a", "b"), ("b", "a")])
def test_a_joint_means_the_same_whichever_end_is_fastened(world: PhysicsWorld, ends: tuple[str, str]) -> None:
    """Link a is held by the world; the position of the joint is that of its child seen from its parent."""
    pose = "0 0 0 0 0 0" if ends == ("a", "b") else "1 0 0 0 0 0"
    hold = joint("world", "a", "hold", "fixed")
    world.spawn(model(link("a") + link("b", x=1.0) + hold + joint(*ends, pose=pose)))
    world.body("m").set_joints({"j": math.pi / 2})
    turned = world.entity_state("m::b").pose
    turn = 2 * math.atan2(turned.quaternion[1], turned.quaternion[3])
    assert turned.position == pytest.approx((1, 0, 1), abs=1e-6)
    assert turn == pytest.approx(math.pi / 2 if ends == ("a", "b") else -math.pi / 2)


def test_a_closed_loop_is_refused_unless_it_never_moves() -> None:
    text = link("a") + link("b") + link("c") + joint("a", "b") + joint("b", "c", "k") + joint("c", "a", "l")
    with pytest.raises(DescriptionError, match=r"^text:1: <joint name='\w'>: closes a loop of joints of model 'm'"):
        model(text)
    assert model(f"<static>true</static>{text}").static


def test_loose_links_fall_apart_and_come_back_together(make_world: Callable[[], PhysicsWorld]) -> None:
    world = make_world()
    world.spawn(model(link("a", x=0.0, z=1.0) + link("b", x=1.0, z=2.0), "pair"))

    def heights() -> list[float]:
        return [world.entity_state(f"pair::{name}").pose.position[2] for name in ("a", "b")]

    assert heights() == pytest.approx([1, 2])
    world.set_state("pair", BodyState(Pose((0, 0, 5)), Twist()))
    assert heights() == pytest.approx([6, 7])
    for _ in range(100):
        world.step()
    fallen = 0.5 * 9.81 * 0.2**2
    assert heights() == pytest.approx([6 - fallen, 7 - fallen], abs=0.01)
    assert world.names() == ["floor", "pair"]
    world.reset_poses()
    assert heights() == pytest.approx([1, 2])
    world.delete("pair")
    assert world.names() == ["floor"]
    with pytest.raises(UnknownEntityError):
        world.entity_state("pair::b")
    assert world.engine.api.getNumBodies(physicsClientId=world.engine.client) == 1


def test_links_of_models_in_models_are_found_by_their_whole_name(world: PhysicsWorld) -> None:
    inner = f"<model name='inner'><pose>0 0 1 0 0 0</pose>{link('b', z=2.0)}</model>"
    world.spawn(model(link("a") + inner + joint("a", "inner::b", kind="fixed"), "outer"))
    assert world.entity_state("outer::inner::b").pose.position == pytest.approx((0, 0, 3))
    with pytest.raises(UnknownEntityError):
        world.entity_state("outer::inner::c")
    with pytest.raises(UnknownEntityError):
        world.entity_state("other::inner::b")


def test_an_inertia_of_the_file_is_the_one_the_engine_has(world: PhysicsWorld) -> None:
    body = world.spawn(model("<link name='a'/>" + link("b") + joint("a", "b", kind="fixed")))
    api, client = world.engine.api, world.engine.client
    moments = [api.getDynamicsInfo(body.number, index, physicsClientId=client)[2] for index in (-1, 0)]
    assert moments[0] == pytest.approx((1, 1, 1))
    assert moments[1] == pytest.approx((1e-3, 1e-3, 1e-3))


def test_the_links_of_a_description_are_where_the_engine_has_them(world: PhysicsWorld) -> None:
    links = link("a") + link("b", x=0.5) + link("c", x=1.0, z=1.5) + link("d", x=1.0, z=1.7)
    joints = joint("a", "b", pose="0.1 0 0.05 0.3 0.2 0.1") + joint("c", "b", "slide", "prismatic", "0 0.2 0 0 0.4 1")
    made = model(links + joints + joint("c", "d", "bolt", "fixed"))
    world.spawn(made)
    world.set_state("m", BodyState(Pose.from_xyz_rpy((0.3, -0.2, 1.0), (0.1, 0.2, 0.3)), Twist()))
    body, positions = world.body("m"), {"j": 0.4, "slide": -0.15}
    body.set_joints(positions)
    model_in_world = body.state().pose
    found = link_poses(made, positions)
    assert set(found) == {"a", "b", "c", "d"}
    for name, pose in found.items():
        expected = body.link_state(name).pose
        distance_m, angle_rad = (model_in_world @ pose).distance_to(expected)
        assert distance_m < 1e-5 and angle_rad < 1e-3, name  # the arc cosine of small angles is inaccurate


def test_loose_links_have_no_pose_in_the_frame_of_the_model() -> None:
    assert set(link_poses(model(link("a") + link("b", x=1.0)), {})) == {"a"}
    assert set(link_poses(model("<static>1</static>" + link("a") + link("b", x=1.0)), {})) == {"a", "b"}
