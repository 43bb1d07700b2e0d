# SPDX-License-Identifier: BSD-3-Clause
"""What every collision checker must do, judged by plain Coal on the raw meshes of the same scene.

A checker of one's own is tested by its name in CHECKERS (as the parameter `collision_detector` has it), with its module
on PYTHONPATH.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from plain_coal_checker import PlainCoalChecker, samples_of

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.collision_detection.kernels.compiled_penetration import TOUCH_COST_M
from modular_framework_planning.contacts import Contact
from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.geometry.shapes import Box, Cylinder, Plane, Sphere
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planners.stomp.costs import collision_costs
from modular_framework_planning.planning_interface.collision_checker import CollisionChecker
from modular_framework_planning.planning_interface.collision_detectors import COLLISION_DETECTORS, collision_detector
from modular_framework_planning.planning_interface.motion_check import MotionChecker
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
)
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_scene.padding import uniform_padding
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import package_resolver
from modular_framework_testing.planning.collision_worlds import random_state, world_with
from modular_framework_testing.planning.independent_checker import IndependentChecker

PLAIN = "plain_coal_checker/PlainCoalChecker"
SHIPPED = tuple({factory: name for name, factory in reversed(COLLISION_DETECTORS.items())}.values())
CHECKERS = (*SHIPPED, PLAIN)  # the checkers to test; one of your own is one more name

STEP = 0.1  # [rad or m]
STATES, PATHS, PATHS_TRIED, SLOW_STATES = 30, 20, 120, 5
SAME_DISTANCE, SAME_DEPTH = 2.0e-4, 1.0e-3  # [m]
JOINTS = (
    ("pan", "revolute", "0 0 1", "base", "column", ""),
    ("lift", "revolute", "0 1 0", "column", "upper", ""),
    ("bend", "revolute", "0 1 0", "upper", "lower", ""),
    ("slide", "prismatic", "0 1 0", "lower", "finger", ""),
    ("follow", "prismatic", "0 -1 0", "lower", "thumb", '<mimic joint="slide"/>'),
)
SHAPES = {
    "base": '<box size="0.3 0.3 0.1"/>',
    "column": '<cylinder radius="0.06" length="0.2"/>',
    "upper": '<box size="0.08 0.08 0.4"/>',
    "lower": '<cylinder radius="0.03" length="0.36"/>',
    "finger": '<box size="0.02 0.02 0.05"/>',
    "thumb": '<sphere radius="0.02"/>',
}
AT = {"base": 0.05, "column": 0.1, "upper": 0.2, "lower": 0.18, "finger": 0.025, "thumb": 0.025}
LONG = {"pan": 0.1, "lift": 0.25, "bend": 0.45, "slide": 0.38, "follow": 0.38}
SMALL_URDF = (
    '<robot name="small">'
    + "".join(
        f'<link name="{name}"><collision><origin xyz="0 0 {AT[name]}"/><geometry>{shape}</geometry></collision></link>'
        for name, shape in SHAPES.items()
    )
    + "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 {LONG[name]}"/><axis xyz="{axis}"/><limit lower="{0.02 if kind == "prismatic" else -2.6}" '
        f'upper="{0.08 if kind == "prismatic" else 2.6}" velocity="1" effort="1"/>{mimic}</joint>'
        for name, kind, axis, parent, child, mimic in JOINTS
    )
    + "</robot>"
)
SMALL_SRDF = (
    (
        '<robot name="small"><group name="arm"><joint name="pan"/><joint name="lift"/><joint name="bend"/>'
        '</group><group name="hand"><joint name="slide"/></group>'
    )
    + "".join(
        f'<disable_collisions link1="{parent}" link2="{child}" reason="Adjacent"/>'
        for _, _, _, parent, child, _ in JOINTS
    )
    + "</robot>"
)


@dataclass(frozen=True)
class Cell:
    """A robot that holds something in a world, and its groups of an arm and of joints near the tip."""

    scene: PlanningScene
    arm: str
    seed: int

    @property
    def model(self) -> RobotModel:
        return self.scene.model

    def states(self, count: int) -> list[np.ndarray]:
        rng = np.random.default_rng(self.seed)
        return [random_state(self.model, rng) for _ in range(count)]


def thing(name: str, shape: object, *position: float) -> CollisionObject:
    return CollisionObject(name, pin.SE3(np.eye(3), np.array(position)), ((shape, pin.SE3.Identity()),))


def small_scene() -> PlanningScene:
    """The small arm, which holds a ball beyond its fingers, between three things."""
    scene = empty_scene(RobotModel(SMALL_URDF, SMALL_SRDF))
    for item in (
        thing("table", Box(0.5, 1.0, 0.04), 0.7, 0.0, 0.3),
        thing("post", Cylinder(1.0, 0.05), -0.3, 0.4, 0.5),
        thing("ball", Sphere(0.15), 0.2, -0.5, 0.9),
    ):
        scene = scene.with_object(item)
    return scene.with_attached(
        AttachedObject(thing("held", Sphere(0.03), 0.0, 0.0, 0.42), "lower", frozenset(("finger", "thumb")))
    )


@pytest.fixture(scope="module", params=["small", "ur5"])
def cell(request: pytest.FixtureRequest) -> Cell:
    if request.param == "small":
        return Cell(small_scene(), "arm", 1)
    robot = request.getfixturevalue("robot")
    second = IndependentChecker(robot.urdf, robot.srdf, package_resolver)
    return Cell(world_with(robot.model, second, np.random.default_rng(5), 0), "arm_and_manipulator", 2)


Make = Callable[..., CollisionChecker]


@pytest.fixture(scope="module", params=CHECKERS)
def make(request: pytest.FixtureRequest) -> Make:
    return collision_detector(request.param)


def described(contacts: list[Contact]) -> set[frozenset[tuple[str, str]]]:
    """The bodies of each contact, by kind and name."""
    return {frozenset((body.kind, body.name) for body in (item.first, item.second)) for item in contacts}


def both(
    cell: Cell, make: Make, moving: object = None, scene: PlanningScene | None = None
) -> tuple[CollisionChecker, PlainCoalChecker]:
    scene = scene or cell.scene
    return make(scene, moving), PlainCoalChecker(scene, moving)


def assert_same_verdicts(checker: CollisionChecker, judge: PlainCoalChecker, states: list[np.ndarray]) -> list[bool]:
    verdicts = [checker.is_free(state) for state in states]
    assert verdicts == [judge.is_free(state) for state in states]
    return verdicts


def test_states(cell: Cell, make: Make) -> None:
    verdicts = assert_same_verdicts(*both(cell, make), cell.states(STATES))
    assert 0.05 * STATES < sum(verdicts) < 0.95 * STATES


def test_paths(cell: Cell, make: Make) -> None:
    indices = cell.model.group(cell.arm).indices
    checker, judge = both(cell, make, indices)
    rng, verdicts = np.random.default_rng(3), []
    for start in (state for state in cell.states(PATHS_TRIED) if judge.is_free(state)):
        vertices = np.repeat(start[None], 3, axis=0)
        vertices[1:, indices] += rng.uniform(-0.4, 0.4, (2, len(indices)))
        touching = [not judge.is_free(sample) for sample in samples_of(vertices, STEP)]
        assert checker.path_is_free(vertices, STEP) == (not any(touching))
        assert checker.path_is_free(vertices, STEP, 1) == (not any(touching[1:]))
        found = checker.colliding_state(vertices, STEP)
        assert (found is None) == (not any(touching))
        if found is not None:
            assert not judge.is_free(found)
            assert np.abs(samples_of(vertices, STEP) - found).max(axis=1).min() < 1e-9
        verdicts.append(not any(touching))
        if len(verdicts) == PATHS:
            break
    assert 0 < sum(verdicts) < len(verdicts)


def test_the_first_sample_may_be_left_out_and_a_path_may_have_one_vertex(cell: Cell, make: Make) -> None:
    checker, judge = both(cell, make)
    states = cell.states(STATES)
    free = next(state for state in states if judge.is_free(state))
    touching = next(state for state in states if not judge.is_free(state))
    for vertices, first, is_free in (
        ((free,), 0, True),
        ((touching,), 0, False),
        ((touching, touching), 1, False),
        ((free, free), 1, True),
        ((free, free), 0, True),
    ):
        assert checker.path_is_free(np.array(vertices), STEP, first) is is_free
    memory = np.array([free])
    assert checker.path_is_free(memory, STEP)
    memory[0] = touching  # the caller's working memory
    assert not checker.path_is_free(memory, STEP) and not checker.is_free(touching)


def test_contacts_name_every_pair_that_touches(cell: Cell, make: Make) -> None:
    for moving in (None, cell.model.group(cell.arm).indices[-1:]):
        checker, judge = both(cell, make, moving)
        for state in cell.states(SLOW_STATES):
            for include_fixed in (True, False):
                found = checker.contacts(state, include_fixed)
                assert described(found) == described(judge.contacts(state, include_fixed))
                depths = [item.depth for item in found]
                assert depths == sorted(depths, reverse=True) and all(depth >= 0.0 for depth in depths)
            assert described(checker.fixed_contacts(state)) == described(judge.fixed_contacts(state))
    assert described(checker.contacts(state, True)) == described(
        [*checker.contacts(state, False), *checker.fixed_contacts(state)]
    )


def test_depth_position_and_normal_of_a_contact(make: Make) -> None:
    scene = small_scene()
    state = scene.model.default_positions()
    tip = scene.frame_transform("lower", state).translation + [0.0, 0.0, 0.42]
    scene = scene.with_object(thing("block", Box(0.2, 0.2, 0.2), *(tip + [0.0, 0.0, 0.13 - 0.01])))
    found = [item for item in make(scene).contacts(state) if "block" in (item.first.name, item.second.name)]
    assert [item.first.name for item in found] == ["held"]
    assert abs(found[0].depth - 0.01) < SAME_DEPTH
    assert np.linalg.norm(found[0].position - tip - [0.0, 0.0, 0.025]) < 0.03
    assert found[0].normal @ [0.0, 0.0, 1.0] > 0.99


def test_distance(cell: Cell, make: Make) -> None:
    checker, judge = both(cell, make)
    for state in cell.states(SLOW_STATES):
        ours, theirs = checker.distance(state), judge.distance(state)
        assert abs(ours - theirs) < SAME_DISTANCE or (ours <= 0.0 and theirs <= 0.0)


def test_bodies_far_away_add_no_exact_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    near = small_scene()
    far = near.with_object(thing("ground", Plane(0.0, 0.0, 1.0, 0.0), 0.0, 0.0, -5.0))
    for index in range(10):
        far = far.with_object(thing(f"far_{index}", Sphere(0.1), 5.0, index, 0.0))
    computed: list[object] = []
    coal_distance = coal.distance

    def counted_distance(first: Any, *arguments: Any) -> float:
        if not isinstance(first, coal.Plane):  # the distance of a sphere from a plane is a bound
            computed.append(first)
        return coal_distance(first, *arguments)

    state = near.model.default_positions()
    expected = PlainCoalChecker(far).distance(state)
    monkeypatch.setattr(coal, "distance", counted_distance)
    distances, counts = [], []
    for scene in (near, far):
        computed.clear()
        distances.append(ExactCollisionChecker(scene).distance(state))
        counts.append(len(computed))
    assert distances == pytest.approx([expected] * 2, abs=SAME_DISTANCE)
    assert 0 < counts[0] == counts[1]


def test_only_pairs_that_the_moving_joints_change_count(cell: Cell, make: Make) -> None:
    last = cell.model.group(cell.arm).indices[-1:]
    verdicts = assert_same_verdicts(*both(cell, make, last), cell.states(STATES))
    assert sum(verdicts) > sum(PlainCoalChecker(cell.scene).is_free(state) for state in cell.states(STATES))


def test_pairs_that_are_allowed_may_touch(cell: Cell, make: Make) -> None:
    state = next(item for item in cell.states(STATES) if PlainCoalChecker(cell.scene).contacts(item))
    acm = cell.scene.acm
    for item in PlainCoalChecker(cell.scene).contacts(state):
        assert not make(cell.scene.with_acm(acm)).is_free(state)
        acm = acm.with_entry(item.first.name, item.second.name, True)
    checker, judge = both(cell, make, scene=cell.scene.with_acm(acm))
    assert checker.is_free(state) and not checker.contacts(state)
    assert_same_verdicts(checker, judge, cell.states(STATES // 2))


def test_a_held_object_may_touch_its_links_and_nothing_else(make: Make) -> None:
    scene = small_scene().without_objects()
    state = scene.model.default_positions()
    held = scene.attached["held"]
    inside = thing("held", Sphere(0.03), 0.0, 0.0, 0.38)
    assert make(scene.with_attached(AttachedObject(inside, "lower", held.touch_links))).is_free(state)
    strict = make(scene.with_attached(AttachedObject(thing("held", Sphere(0.05), 0.0, 0.0, 0.4), "lower", frozenset())))
    assert not strict.is_free(state)
    assert described(strict.contacts(state)) == {
        frozenset((("robot_attached", "held"), ("robot_link", name))) for name in ("finger", "thumb")
    }


def test_padding_keeps_the_world_away_and_leaves_the_robot_alone(cell: Cell, make: Make) -> None:
    links = {item.link for item in cell.model.link_geometries}
    padded = cell.scene.with_padding(uniform_padding(links, 0.03, 1.0, 0.0, 0.02))
    states = cell.states(STATES // 2)
    verdicts = assert_same_verdicts(*both(cell, make, scene=padded), states)
    assert sum(verdicts) < sum(PlainCoalChecker(cell.scene).is_free(state) for state in states)
    alone = padded.without_objects()
    assert_same_verdicts(make(alone), PlainCoalChecker(cell.scene.without_objects()), states)
    state = next(item for item in states if PlainCoalChecker(padded).contacts(item))
    assert described(make(padded).contacts(state)) == described(PlainCoalChecker(padded).contacts(state))


def test_a_padded_contact_is_as_deep_as_what_is_missing(make: Make) -> None:
    scene = small_scene().without_objects()
    state = scene.model.default_positions()
    tip = scene.frame_transform("lower", state).translation + [0.0, 0.0, 0.42]
    scene = scene.with_object(thing("block", Box(0.2, 0.2, 0.2), *(tip + [0.0, 0.0, 0.13 + 0.01])))
    assert make(scene).is_free(state)
    padded = make(scene.with_padding(uniform_padding((), 0.0, 1.0, 0.0, 0.015)))
    assert not padded.is_free(state)
    assert abs(padded.contacts(state)[0].depth - 0.005) < SAME_DEPTH
    assert abs(padded.distance(state)) < 0.02


def test_a_tolerated_contact_may_stay_but_not_deepen(make: Make) -> None:
    scene = small_scene().without_objects()
    model, state = scene.model, scene.model.default_positions()
    state[model.index["lift"]] = 2.2  # the ball is the lowest
    ball = scene.frame_transform("lower", state).act(np.array([0.0, 0.0, 0.42]))
    scene = scene.with_object(thing("floor", Box(0.3, 0.3, 0.1), *(ball - [0.0, 0.0, 0.08 - 0.002])))
    contacts = make(scene).contacts(state)
    assert described(contacts) == {frozenset((("robot_attached", "held"), ("world_object", "floor")))}
    checker = make(scene, None, contacts)
    higher, deeper = state.copy(), state.copy()
    higher[model.index["lift"]] -= 0.02
    deeper[model.index["lift"]] += 0.01
    assert checker.is_free(state) and checker.is_free(higher) and not checker.is_free(deeper)
    assert not checker.contacts(state) and checker.contacts(deeper)
    assert checker.path_is_free(np.array([state, higher]), 0.005)
    assert not checker.path_is_free(np.array([state, deeper]), 0.005, 1)
    assert checker.colliding_state(np.array([state, deeper]), 0.005) is not None


def test_joints_that_mimic_follow(make: Make) -> None:
    scene = small_scene()
    indices = scene.model.group("hand").indices
    motion = MotionChecker(make(scene, indices), indices, scene.model.default_positions())
    thumb = scene.frame_transform("thumb", motion.full_positions(np.array([0.07]))).translation
    blocked = scene.with_object(thing("stop", Sphere(0.01), *(thumb + [0.0, 0.0, 0.05])))
    motion = MotionChecker(make(blocked, indices), indices, scene.model.default_positions())
    assert motion.state_is_free(np.array([0.03])) and not motion.state_is_free(np.array([0.07]))
    assert not motion.edge_is_free(np.array([0.03]), np.array([0.08]), 0.01)


def test_building_changes_no_answer_and_can_be_stopped(cell: Cell, make: Make) -> None:
    built = make(cell.scene)
    built.build(lambda: None)
    assert_same_verdicts(built, PlainCoalChecker(cell.scene), cell.states(5))

    def stop() -> None:
        raise TimeoutError

    stopped = make(cell.scene)
    with contextlib.suppress(TimeoutError):
        stopped.build(stop)
    assert_same_verdicts(stopped, PlainCoalChecker(cell.scene), cell.states(5))


def test_costs_are_0_for_free_states_and_at_least_a_step_for_others(cell: Cell, make: Make) -> None:
    checker, judge = both(cell, make)
    states = np.array(cell.states(STATES))
    costs = collision_costs(checker, states)  # its own, or made of its contacts
    free = np.array([judge.is_free(state) for state in states])
    assert costs.shape == (STATES,) and (costs[free] == 0.0).all() and (costs[~free] >= TOUCH_COST_M).all()


@pytest.mark.parametrize(
    "planner",
    ["ompl_interface/OMPLPlanner", "pilz_industrial_motion_planner/CommandPlanner", "stomp_moveit/StompPlanner"],
)
@pytest.mark.parametrize("detector", dict.fromkeys(("FCL", PLAIN)))
def test_pipelines_plan_with_the_checker_that_is_named(planner: str, detector: str) -> None:
    scene = small_scene()
    model = scene.model
    start = model.merge(model.default_positions(), {"pan": -0.4, "lift": 0.9, "slide": 0.03})
    settings = PipelineSettings(
        seed=1,
        motion_step=1.0,
        parameters={"num_timesteps": 10},
        robot_planning={
            "cartesian_limits": {"max_trans_vel": 1.0, "max_trans_acc": 1.0, "max_trans_dec": -1.0, "max_rot_vel": 1.0}
        },
    )
    pipeline = PipelineSpec("any", planner, settings=settings, collision_detector=detector).build(
        model, KinematicsPool(model)
    )
    planner_id = "PTP" if "pilz" in planner else ""
    request = PlanningRequest(
        scene.with_positions(start),
        "arm",
        (JointGoal({"pan": 0.3, "lift": 0.3, "bend": 0.2}),),
        planner_id=planner_id,
        attempts=1,
        allowed_time_s=60.0,
        velocity_scaling=1.0,
        acceleration_scaling=1.0,
    )
    answer = pipeline.plan(request)
    judge = PlainCoalChecker(scene)
    assert all(
        judge.is_free(model.merge(start, dict(zip(answer.trajectory.joint_names, row, strict=True))))
        for row in answer.trajectory.positions
    )
    assert type(pipeline.checker(scene, model.group("arm"), start)) is collision_detector(detector)
    blocked = PlanningRequest(
        scene.with_positions(start), "arm", (JointGoal({"pan": 0.0, "lift": 1.6}),), planner_id=planner_id
    )
    with pytest.raises(PlanningError, match="table"):
        pipeline.plan(blocked)


class Half:
    """A checker without most methods."""

    def is_free(self, _positions: np.ndarray) -> bool:
        return True


def test_names_of_checkers() -> None:
    assert collision_detector() is collision_detector("") is collision_detector("Hybrid") is ExactCollisionChecker
    assert collision_detector(PLAIN) is PlainCoalChecker
    for name, reason in (
        ("Unknown", "allowed: FCL, Bullet, HYBRID and module/Class"),
        ("no_such_module/Checker", "no_such_module"),
        ("plain_coal_checker/Missing", "Missing"),
        ("test_collision_checkers/Half", "no method build, path_is_free, colliding_state"),
    ):
        with pytest.raises(ModelError, match=reason):
            collision_detector(name)
