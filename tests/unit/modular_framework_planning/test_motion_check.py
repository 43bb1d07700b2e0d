# SPDX-License-Identifier: BSD-3-Clause
"""What lies on an edge that was found free is not checked again; everything else is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from modular_framework_planning.planning_interface.motion_check import MotionChecker

FINE = 0.004  # [rad]


class RecordingChecker:
    """A checker of two joints in whose way nothing is, but for a strip of the first joint; keeps what it was asked."""

    model = SimpleNamespace(mimics=())

    def __init__(self) -> None:
        self.strip = (10.0, 11.0)
        self.edges: list[np.ndarray] = []
        self.paths: list[np.ndarray] = []

    def path_is_free(self, vertices: np.ndarray, step: float, first: int = 0) -> bool:
        """Whether no vertex lies in the strip."""
        self.edges.append(np.array(vertices))
        return self._colliding(vertices) is None

    def colliding_state(self, vertices: np.ndarray, step: float) -> np.ndarray | None:
        """The first vertex in the strip."""
        self.paths.append(np.array(vertices))
        return self._colliding(vertices)

    def _colliding(self, vertices: np.ndarray) -> np.ndarray | None:
        return next((row for row in vertices if self.strip[0] <= row[1] <= self.strip[1]), None)


@pytest.fixture()
def checker() -> RecordingChecker:
    return RecordingChecker()


@pytest.fixture()
def motion(checker: RecordingChecker) -> MotionChecker:
    return MotionChecker(checker, np.array([1, 2]), np.zeros(3), FINE)  # type: ignore[arg-type]


def test_pieces_on_a_free_edge_are_left_out_and_all_vertices_are_checked(
    motion: MotionChecker, checker: RecordingChecker
) -> None:
    assert motion.edge_is_free(np.zeros(2), np.array([3.0, 1.5]), FINE)
    line = np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 1.0], [2.1, 1.2], [2.1, 1.3]])
    assert motion.colliding_state(line, FINE) is None
    assert [len(path) for path in checker.paths] == [1, 1, 3]
    np.testing.assert_allclose(np.vstack(checker.paths)[:, 1:], line)


def test_pieces_beside_a_free_edge_or_beyond_its_end_are_checked(
    motion: MotionChecker, checker: RecordingChecker
) -> None:
    assert motion.edge_is_free(np.zeros(2), np.array([3.0, 1.5]), FINE)
    for piece in ([[0.0, 1e-6], [1.0, 0.5]], [[2.0, 1.0], [3.1, 1.55]], [[0.0, 0.0], [0.5, 1.0]]):
        checker.paths.clear()
        motion.colliding_state(np.array(piece), FINE)
        assert [len(path) for path in checker.paths] == [2]


def test_an_edge_counts_only_for_steps_as_wide_as_those_it_was_checked_at(
    motion: MotionChecker, checker: RecordingChecker
) -> None:
    edge = np.array([[0.0, 0.0], [3.0, 1.5]])
    assert motion.edge_is_free(*edge, 0.05)
    motion.colliding_state(edge, FINE)
    assert motion.edge_is_free(*edge, FINE)
    motion.colliding_state(edge, 0.1 * FINE)
    assert [len(path) for path in checker.paths] == [2, 2]
    motion.colliding_state(edge, 0.05)
    assert [len(path) for path in checker.paths] == [2, 2, 1, 1]


def test_a_verdict_on_an_edge_is_asked_for_once_and_a_colliding_edge_stays_colliding(
    motion: MotionChecker, checker: RecordingChecker
) -> None:
    free, blocked = np.array([[0.0, 0.0], [3.0, 1.5]]), np.array([[3.0, 1.5], [10.5, 0.0]])
    assert [motion.edge_is_free(*edge, FINE) for edge in (free, blocked, free, blocked)] == [True, False, True, False]
    assert len(checker.edges) == 2
    found = motion.colliding_state(np.array([[0.0, 0.0], [3.0, 1.5], [10.5, 0.0]]), FINE)
    np.testing.assert_allclose(found, [10.5, 0.0])
