# SPDX-License-Identifier: BSD-3-Clause
"""Messages of which only the moved entries are serialized again say the same as the world at every instant."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO

import pytest

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.physics import pybullet_rest
from modular_framework_simulation.physics.part_names import SCOPE
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import BodyState, Twist
from modular_framework_testing.simulation.simulated_samples import run, solid

pytest.importorskip("gazebo_msgs.msg", reason="source the workspace: the messages are not built")

from gazebo_msgs.msg import LinkStates, ModelStates  # noqa: E402

from modular_framework_simulation.gazebo_ros.packed_states import (  # noqa: E402
    PackedLinkStates,
    PackedModelStates,
    PackedStates,
)

CUBE = specs.Box((0.05, 0.05, 0.05))
PAIR = """<sdf version='1.6'><model name='pair'><pose>0 2 0.5 0 0 0</pose>
  <link name='a'><collision name='c'><geometry><box><size>.1 .1 .1</size></box></geometry></collision></link>
  <link name='b'><pose>0 0 .2 0 0 0</pose></link>
  <joint name='j' type='revolute'><parent>a</parent><child>b</child><axis><xyz>1 0 0</xyz></axis></joint>
  </model></sdf>"""


def received(message: object, kind: type) -> dict[str, tuple[float, ...]]:
    """Pose and twist of each entry, as a subscriber reads them."""
    buffer = BytesIO()
    message.serialize(buffer)
    read = kind().deserialize(buffer.getvalue())
    found = {}
    for name, pose, twist in zip(read.name, read.pose, read.twist, strict=True):
        parts = (pose.position, pose.orientation, twist.linear, twist.angular)
        found[name] = tuple(getattr(part, axis) for part in parts for axis in part.__slots__)
    return found


def numbers(state: BodyState) -> tuple[float, ...]:
    return (*state.pose.position, *state.pose.quaternion, *state.twist.linear, *state.twist.angular)


def test_packed_states_equal_the_states_of_the_world(
    make_world: Callable[..., PhysicsWorld], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pybullet_rest, "MAX_ASLEEP", 0)
    world = make_world()
    models, links = PackedModelStates(), PackedLinkStates()
    models.packed = PackedStates(world, lambda name: [(name, world.body(name).state())])

    def states_of_links(name: str) -> list[tuple[str, BodyState]]:
        body = world.body(name)
        return [(f"{name}{SCOPE}{link}", body.link_state(link)) for link in body.link_names()]

    links.packed = PackedStates(world, states_of_links)

    def require_equal() -> None:
        for message, kind in ((models, ModelStates), (links, LinkStates)):
            message.packed.update()
            found = received(message, kind)
            assert found == {name: numbers(world.entity_state(name)) for name in found}
        assert list(received(models, ModelStates)) == world.names()
        assert ("pair" in world.names()) == ("pair::b" in received(links, LinkStates))

    require_equal()
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.3))))
    world.spawn(read_model_text(PAIR, "text", Resources()))
    for _ in range(150):  # falls, settles, and is stored
        run(world, 0.04)
        require_equal()
    world.spawn(solid("ball", specs.Sphere(0.05), Pose((-0.5, 0, 0.05)), mass=2.0))
    world.set_state("ball", BodyState(Pose((-0.5, 0, 0.05)), Twist((3.0, 0, 0))))
    for _ in range(10):  # hits the cube
        run(world, 0.04)
        require_equal()
    assert world.entity_state("cube").pose.position[0] > 0.1
    world.delete("pair")
    require_equal()


def test_states_of_models_that_do_not_move_are_read_once(make_world: Callable[..., PhysicsWorld]) -> None:
    world = make_world()
    world.spawn(solid("table", CUBE, Pose((0, 0, 0.5)), static=True))
    world.spawn(solid("cube", CUBE, Pose((0, 0, 0.8))))
    read: list[str] = []

    def states(name: str) -> list[tuple[str, BodyState]]:
        read.append(name)
        return [(name, world.body(name).state())]

    packed = PackedStates(world, states)
    packed.update()
    assert read == ["floor", "table", "cube"]
    run(world, 0.02)
    packed.update()
    assert read[3:] == ["cube"]
