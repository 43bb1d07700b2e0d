# SPDX-License-Identifier: BSD-3-Clause
"""Verdicts on whole paths, which look at few samples, against a look at every sample.

That the verdict on one sample is right is shown in test_collision_verdicts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from modular_framework_planning.collision_detection import exact_collision_checker
from modular_framework_planning.collision_detection.exact_collision import ExactCollision
from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, PlanningScene, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import package_resolver
from modular_framework_testing.planning.collision_worlds import shape_of, world_with
from modular_framework_testing.planning.independent_checker import IndependentChecker

ARM_WORLDS, ARM_PATHS = 5, 6
BARS_PATHS, OBSTACLES = 150, 30
STEP = 0.01  # [rad or m]
FINE_STEP = 1.0e-6  # [rad or m]
LONGEST_WAY = 60  # [STEP]
THICK, LONG = 0.02, 0.4  # of a bar [m]
BARS = (("continuous", "0 0 1"), ("revolute", "0 1 0"), ("revolute", "0 1 0"), ("prismatic", "1 0 0"))
BARS_URDF = (
    '<robot name="bars"><link name="link0"/>'
    + "".join(
        f"""
<link name="link{n}"><collision><origin xyz="{LONG / 2} 0 0"/><geometry><mesh filename="bar"/></geometry></collision>
</link><joint name="joint{n}" type="{kind}"><parent link="link{n - 1}"/><child link="link{n}"/>
<origin xyz="{LONG if n > 1 else 0} 0 0"/><axis xyz="{axis}"/>
<limit lower="-7" upper="7" velocity="1" effort="1"/></joint>"""
        for n, (kind, axis) in enumerate(BARS, 1)
    )
    + "</robot>"
)
BARS_SRDF = (
    '<robot name="bars"><group name="arm"><chain base_link="link0" tip_link="link4"/></group>'
    + "".join(f'<disable_collisions link1="link{n}" link2="link{n + 1}" reason="Adjacent"/>' for n in range(4))
    + "</robot>"
)


class Neighbourhood:
    """A group of joints in a world, and paths that graze something there."""

    def __init__(self, scene: PlanningScene, group: str) -> None:
        self.scene, self.indices = scene, scene.model.group(group).indices
        self._rest = scene.model.default_positions()
        self.ours = ExactCollisionChecker(scene, self.indices)

    def full_positions(self, values: np.ndarray) -> np.ndarray:
        """Positions of the whole robot."""
        positions = self._rest.copy()
        positions[self.indices] = values
        return positions

    def free_steps(self, start: np.ndarray, way: np.ndarray) -> int:
        """How many times that way can be gone before something touches, at most LONGEST_WAY."""
        return next(
            (
                number - 1
                for number in range(1, LONGEST_WAY + 1)
                if not self.ours.is_free(self.full_positions(start + number * way))
            ),
            LONGEST_WAY,
        )

    def way_into_contact(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, int]:
        """Free joint values, a way of about STEP, and how many of those are free before the first contact.

        One joint moves, or about half of them; whole turns make no difference to what touches.
        """
        count = len(self.indices)
        while True:
            start = rng.uniform(-np.pi, np.pi, count) + 2.0 * np.pi * rng.integers(-1, 2, count)
            moves = np.arange(count) == rng.integers(count) if rng.random() < 0.5 else rng.random(count) < 0.6
            if not moves.any() or not self.ours.is_free(self.full_positions(start)):
                continue
            way = rng.normal(size=count) * moves
            way *= 0.999 * STEP / np.abs(way).max()
            free = self.free_steps(start, way)
            if free < LONGEST_WAY:
                return start, way, free

    def grazing_path(self, rng: np.random.Generator) -> np.ndarray:
        """A path, free but for its turn, where it may touch for a few samples; vertices (5, joints)."""
        start, way, free = self.way_into_contact(rng)
        behind = self.free_steps(start, -way)
        turn = start + (free + rng.integers(0, 3)) * way
        ends = [start - rng.random() * behind * way for _ in range(3)]
        return np.array([self.full_positions(row) for row in (ends[0], ends[1], turn, turn, ends[2])])

    def path_up_to_contact(self, rng: np.random.Generator) -> np.ndarray:
        """A free path that ends within FINE_STEP of contact; vertices (2, joints)."""
        start, way, free = self.way_into_contact(rng)
        apart, touching = float(free), free + 1.0
        while (touching - apart) * STEP > FINE_STEP:
            middle = 0.5 * (apart + touching)
            apart, touching = (
                (middle, touching) if self.ours.is_free(self.full_positions(start + middle * way)) else (apart, middle)
            )
        return np.array([self.full_positions(start + free * way), self.full_positions(start + apart * way)])

    def touching_samples(self, path: np.ndarray) -> int:
        """Compares the verdicts on a path with those on its samples; returns how many of these touch."""
        samples = samples_of(path)
        touching = np.array([not self.ours.is_free(sample) for sample in samples])
        assert self.ours.path_is_free(path, STEP) == (not touching.any())
        later = touching[len(samples_of(path[:2])) :]
        assert self.ours.path_is_free(path[1:], STEP, 1) == (not later.any())
        found = self.ours.colliding_state(path, STEP)
        assert (found is None) == (not touching.any())
        assert found is None or np.abs(samples[touching] - found).max(axis=1).min() < 1e-9
        return int(touching.sum())


def samples_of(vertices: np.ndarray) -> np.ndarray:
    """Samples at most STEP apart on the straight pieces, shape (n, joints)."""
    rows = [vertices[:1]]
    for start, end in zip(vertices[:-1], vertices[1:], strict=True):
        count = max(1, int(np.ceil(np.abs(end - start).max() / STEP)))
        rows.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return np.vstack(rows)


def arm_worlds(robot: object, rng: np.random.Generator) -> Iterator[Neighbourhood]:
    """The shipped robot, holding something, among things as large as its links."""
    for held in range(ARM_WORLDS):
        second = IndependentChecker(robot.urdf, robot.srdf, package_resolver)
        yield Neighbourhood(world_with(robot.model, second, rng, held), "arm_and_manipulator")


@pytest.fixture(scope="module")
def bars(tmp_path_factory: pytest.TempPathFactory) -> Neighbourhood:
    """Thin bars among small things: the bound on how far a bar moves is not much more than it does move."""
    file = str(tmp_path_factory.mktemp("bars") / "bar.stl")
    trimesh.creation.box((LONG, THICK, THICK)).export(file)
    scene, rng = empty_scene(RobotModel(BARS_URDF, BARS_SRDF, {}, lambda _: file)), np.random.default_rng(41)
    for number in range(OBSTACLES):
        shape, _ = shape_of(number % 5, rng.uniform(1.2, 2.0, 3) * THICK)
        away = rng.normal(size=3)
        place = pin.SE3(np.eye(3), away / np.linalg.norm(away) * rng.uniform(0.5, 3.0) * LONG)
        scene = scene.with_object(CollisionObject(f"thing{number}", place, ((shape, pin.SE3.Identity()),)))
    return Neighbourhood(scene, "arm")


def assert_many_graze(counts: list[int]) -> None:
    """Asserts that free paths and those with few touching samples were among them."""
    assert counts.count(0) > len(counts) / 10 and sum(0 < count <= 5 for count in counts) > len(counts) / 3, counts


@pytest.mark.parametrize("undecided_rows", [exact_collision_checker.INITIAL_UNDECIDED_ROWS, 1])
def test_no_touching_sample_of_an_arms_path_is_passed_over_and_no_free_path_is_refused(
    robot: object, monkeypatch: pytest.MonkeyPatch, undecided_rows: int
) -> None:
    monkeypatch.setattr(exact_collision_checker, "INITIAL_UNDECIDED_ROWS", undecided_rows)
    rng = np.random.default_rng(31 + undecided_rows)
    assert_many_graze(
        [world.touching_samples(world.grazing_path(rng)) for world in arm_worlds(robot, rng) for _ in range(ARM_PATHS)]
    )


def test_no_touching_sample_of_thin_bars_path_is_passed_over_and_no_free_path_is_refused(bars: Neighbourhood) -> None:
    rng = np.random.default_rng(42)
    assert_many_graze([bars.touching_samples(bars.grazing_path(rng)) for _ in range(BARS_PATHS)])


def test_a_path_that_stays_close_to_contact_asks_the_exact_check_about_undecided_pairs_only(
    bars: Neighbourhood, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(44)
    paths = [bars.path_up_to_contact(rng) for _ in range(5)]
    asked: list[int] = []
    touching_pair = ExactCollision.touching_pair

    def counted(exact: ExactCollision, positions: np.ndarray, numbers: Iterable[int]) -> int:
        pairs = list(numbers)
        asked.append(len(pairs))
        return touching_pair(exact, positions, pairs)

    def questions(rows: int) -> list[int]:
        monkeypatch.setattr(exact_collision_checker, "INITIAL_UNDECIDED_ROWS", rows)
        checker = ExactCollisionChecker(bars.scene, bars.indices)
        asked.clear()
        assert all(checker.path_is_free(path, FINE_STEP) for path in paths)
        return list(asked)

    monkeypatch.setattr(ExactCollision, "touching_pair", counted)
    expected = questions(100_000)
    assert len(expected) > 200
    assert questions(1) == expected


def test_the_end_of_an_edge_is_looked_at_and_its_start_is_not(bars: Neighbourhood) -> None:
    rng = np.random.default_rng(43)
    for _ in range(20):
        start, way, number = bars.way_into_contact(rng)
        free, touching = bars.full_positions(start), bars.full_positions(start + (number + 1) * way)
        for edge, first, is_free in (
            ((free, touching), 1, False),
            ((touching, free), 1, True),
            ((touching, free), 0, False),
            ((touching, touching), 1, False),
            ((free, free), 1, True),
            ((touching,), 0, False),
            ((free,), 0, True),
        ):
            assert bars.ours.path_is_free(np.array(edge), STEP, first) is is_free
