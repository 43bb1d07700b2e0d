# SPDX-License-Identifier: BSD-3-Clause
"""The SRDF leaves out exactly the collision checks that can be left out, and the named states are free."""

import math
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio
import pytest
import rospkg

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.sdf_reader import read_world
from modular_framework_simulation.models.sdf_resources import Resources

# Arm states a task may name [rad], in chain order; the framework ships them as configuration.
NAMED_STATES = {
    "initial_pose": (3.1375783963, -1.6559683943, 1.3870131566, -1.2662363723, -1.5707963268, 0),
    "stability_pose": (1.5707963268, -1.5707963268, 1.5707963268, -1.5707963268, -1.5707963268, 0),
    "stability_up": (-3.176499239, -0.66322511576, 0.55850536064, -3.0096457621, -0.2617993878, 1.5707963268),
    "stability_down": (-2.827433388, -0.66322511576, 0.55850536064, -3.0096457621, 0.2617993878, 1.5707963268),
    "stability_right": (-3.0019663134, -0.488692191, 0.820304748, -3.0096457621, 0, 1.5707963268),
    "stability_left": (-3.0019663134, -0.837758041, 0.296705973, -3.0096457621, 0, 1.5707963268),
    "stability_gravity_down": (1.5707963268, -1.5885986852, 0.35028758088, -0.37350045993, -1.5707963268, 0),
    "stability_gravity_side": (1.5707963268, -1.5885986852, 0.35028758088, -1.969429528, -1.5707963268, 0),
}


class Checker:
    """Link pairs in collision, among all pairs, by exact shapes; objects of the world count as links."""

    def __init__(self, urdf: str, model: pinocchio.Model) -> None:
        self.model = model
        self.geometry = pinocchio.buildGeomFromUrdfString(model, urdf, pinocchio.GeometryType.COLLISION)
        self.names = [model.frames[shape.parentFrame].name for shape in self.geometry.geometryObjects]

    def add_pairs(self, skipped: set[frozenset[str]]) -> None:
        for first, second in combinations(range(len(self.names)), 2):
            pair = frozenset((self.names[first], self.names[second]))
            movable = any("__" not in name for name in pair)
            if len(pair) == 2 and movable and pair not in skipped:
                self.geometry.addCollisionPair(pinocchio.CollisionPair(first, second))
        self.data, self.geometry_data = self.model.createData(), self.geometry.createData()

    def colliding(self, state: np.ndarray) -> set[frozenset[str]]:
        pinocchio.computeCollisions(self.model, self.data, self.geometry, self.geometry_data, state, False)
        results = zip(self.geometry.collisionPairs, self.geometry_data.collisionResults, strict=True)
        return {frozenset((self.names[p.first], self.names[p.second])) for p, r in results if r.isCollision()}


def disabled_pairs(srdf: ElementTree.Element) -> dict[frozenset[str], str]:
    return {
        frozenset((str(e.get("link1")), str(e.get("link2")))): str(e.get("reason"))
        for e in srdf.iter("disable_collisions")
    }


def random_states(model: pinocchio.Model, count: int) -> np.ndarray:
    lower, upper = (np.clip(x, -math.pi, math.pi) for x in (model.lowerPositionLimit, model.upperPositionLimit))
    return np.random.default_rng(20).uniform(lower, upper, (count, model.nq))


def test_pairs_that_never_collide_do_not_collide_in_states_nobody_sampled_before(urdf, model, srdf) -> None:
    never = {pair for pair, reason in disabled_pairs(srdf).items() if reason == "Never"}
    checker = Checker(urdf, model)
    checker.add_pairs(set())
    assert never
    for state in random_states(model, 300):
        assert not checker.colliding(state) & never


def test_adjacent_pairs_are_joined_by_one_joint(model, srdf) -> None:
    for pair, reason in disabled_pairs(srdf).items():
        if reason == "Adjacent":
            first, second = (model.frames[model.getFrameId(name)].parentJoint for name in pair)
            assert first == second or first == model.parents[second] or second == model.parents[first]


def test_no_pair_that_can_collide_is_left_out(urdf, model, srdf) -> None:
    allowed = {pair for pair, reason in disabled_pairs(srdf).items() if reason == "Adjacent"}
    checker = Checker(urdf, model)
    checker.add_pairs(allowed)
    collided = set().union(*(checker.colliding(state) for state in random_states(model, 300)))
    assert not collided & set(disabled_pairs(srdf))
    assert frozenset(("forearm_link", "ezgripper_palm_link")) in collided


def coal_shape(geometry: specs.Geometry) -> coal.ShapeBase:
    match geometry:
        case specs.Box():
            return coal.Box(*geometry.size)
        case specs.Cylinder():
            return coal.Cylinder(geometry.radius, geometry.length)
        case specs.Plane():
            return coal.Halfspace(np.array(geometry.normal), 0.0)
    raise AssertionError(geometry)


@pytest.fixture(scope="module")
def scene_checker(urdf, model, srdf) -> Checker:
    folder = Path(rospkg.RosPack().get_path("modular_framework_description"))
    checker = Checker(urdf, model)
    world = read_world(folder / "worlds" / "ur5_setup.world", Resources((folder / "models",)))
    for model_spec, link in ((model, link) for model in world.models for link in model.links):
        for index, collision in enumerate(link.collisions):
            pose = model_spec.pose @ link.pose @ collision.pose
            placement = pinocchio.XYZQUATToSE3(np.array([*pose.position, *pose.quaternion]))
            name = f"{model_spec.name}__{link.name}"
            shape = coal_shape(collision.geometry)
            checker.geometry.addGeometryObject(pinocchio.GeometryObject(f"{name}_{index}", 0, 0, placement, shape))
            checker.names.append(name)
    checker.add_pairs(set(disabled_pairs(srdf)))
    return checker


@pytest.mark.parametrize("knuckle", [0.0, 1.0, 1.94])
@pytest.mark.parametrize("name", NAMED_STATES)
def test_named_arm_states_touch_neither_the_robot_nor_the_set_up(scene_checker, name: str, knuckle: float) -> None:
    assert scene_checker.colliding(np.array([*NAMED_STATES[name], knuckle])) == set()


def test_states_of_the_srdf_are_free_and_inside_the_limits(scene_checker, model, srdf) -> None:
    names = list(model.names)
    for group_state in srdf.iter("group_state"):
        state = np.array([*NAMED_STATES["stability_pose"], 0.0])
        for joint in group_state.iter("joint"):
            index = model.joints[names.index(str(joint.get("name")))].idx_q
            state[index] = float(str(joint.get("value")))
            assert model.lowerPositionLimit[index] <= state[index] <= model.upperPositionLimit[index]
        assert scene_checker.colliding(state) == set()
