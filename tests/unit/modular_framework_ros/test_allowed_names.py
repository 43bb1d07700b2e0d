# SPDX-License-Identifier: BSD-3-Clause
"""A refused name comes with the allowed name that was probably meant."""

from __future__ import annotations

import pytest

from modular_framework_ros.allowed_names import listing, nearest

PLANNERS = ("BKPIECE", "RRTConnect", "RRTstar")


@pytest.mark.parametrize(
    ("found", "meant"),
    [("RRTConect", "RRTConnect"), ("rrtconnect", "RRTConnect"), ("connect", "RRTConnect"), ("RRTstarr", "RRTstar")],
)
def test_the_closest_name_is_suggested(found: str, meant: str) -> None:
    assert nearest(found, PLANNERS) == f"; did you mean '{meant}'?"


@pytest.mark.parametrize("found", ["", "PRM", "nothing like it", "RRTConnect" * 20])
def test_nothing_is_suggested_for_a_name_that_is_like_no_other(found: str) -> None:
    assert nearest(found, PLANNERS) == ""


def test_the_allowed_names_are_listed_once() -> None:
    assert listing(["b", "a", "b"]) == "allowed: b, a"
    assert listing([], "it has none") == "it has none"
