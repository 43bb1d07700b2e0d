# SPDX-License-Identifier: BSD-3-Clause
"""Mimic joints follow one independent joint each; loops and unknown leaders are named."""

from __future__ import annotations

import pytest

from modular_framework_urdf.mimics import Mimic, resolve_mimics, with_leaders


def test_a_chain_of_mimic_joints_follows_its_first_one() -> None:
    found = resolve_mimics({"c": Mimic("b", -2.0, 0.5), "b": Mimic("a", 3.0, 1.0)}, ["a", "b", "c"])
    assert found == {"b": Mimic("a", 3.0, 1.0), "c": Mimic("a", -6.0, -1.5)}
    assert pytest.approx(-6.0 * 0.2 - 1.5) == -2.0 * (3.0 * 0.2 + 1.0) + 0.5


@pytest.mark.parametrize(
    ("mimics", "said"),
    [
        ({"a": Mimic("a", 1.0, 0.0)}, "'a': it mimics itself through a -> a; a joint may mimic one of b, c; remove"),
        (
            {"a": Mimic("b", 1.0, 0.0), "b": Mimic("a", 1.0, 0.0)},
            "itself through a -> b -> a; a joint may mimic one of c",
        ),
        ({"c": Mimic("a", 1.0, 0.0), "a": Mimic("b", 1.0, 0.0), "b": Mimic("a", 1.0, 0.0)}, "through c -> a -> b -> a"),
        ({"a": Mimic("d", 1.0, 0.0)}, "'a': it mimics 'd', which is not a movable joint; allowed: b, c; correct"),
        ({"b": Mimic("a", 1.0, 0.0), "a": Mimic("d", 1.0, 0.0)}, "'a': it mimics 'd'"),
        ({"a": Mimic("b", 0.0, 0.0)}, "'a': it mimics 'b' by multiplier 0.0 and offset 0.0; both must be finite, the"),
        ({"a": Mimic("b", float("inf"), 0.0)}, "multiplier inf"),
    ],
)
def test_what_follows_nothing_that_moves_is_refused(mimics: dict[str, Mimic], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        resolve_mimics(mimics, ["a", "b", "c"])


def test_a_joint_that_mimics_stands_for_its_leader_unless_that_is_named() -> None:
    mimics = {"right": Mimic("left", 2.0, 0.1)}
    assert with_leaders({"right": 0.5, "arm": 1.0}, mimics) == pytest.approx({"left": 0.2, "arm": 1.0})
    assert with_leaders({"right": 0.5, "left": 0.3}, mimics) == {"left": 0.3}


@pytest.mark.parametrize(
    ("multiplier", "offset", "range_of"), [(1.0, 0.0, (0.0, 0.8)), (-1.0, 0.0, (-0.8, 0.0)), (-0.5, 0.1, (-0.3, 0.1))]
)
def test_a_joint_that_mimics_ranges_as_its_leader_takes_it(
    multiplier: float, offset: float, range_of: tuple[float, float]
) -> None:
    assert Mimic("left", multiplier, offset).range_of(0.0, 0.8) == pytest.approx(range_of)
