# SPDX-License-Identifier: BSD-3-Clause
"""Invalid shapes, values, ends and limits in the result of a planner are found."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mbf_method import no_path
from mbf_method.errors import InvalidOutputError
from mbf_method.joint_path import checked_path
from mbf_method.path_request import PathRequest
from mbf_method.sample_inputs import path_requests
from mbf_method.wire import pack, unpack

REQUEST = path_requests()[0]
MIDDLE = np.zeros(3)
PATH = np.array([REQUEST.start, MIDDLE, REQUEST.goals[0]])


def changed(row: int, column: int, value: float) -> np.ndarray:
    path = PATH.copy()
    path[row, column] = value
    return path


def test_a_path_in_single_precision_gets_the_exact_start_and_the_exact_goal() -> None:
    path = checked_path({"positions": PATH.astype(np.float32)}, REQUEST, 3)
    assert path.dtype == np.float64
    assert path[0].tolist() == REQUEST.start.tolist()
    assert path[-1].tolist() == REQUEST.goals[0].tolist()


def test_a_path_may_end_at_any_goal() -> None:
    other = np.array([0.5, 0.5, 0.5])
    request = replace(REQUEST, goals=np.array([REQUEST.goals[0], other]))
    assert checked_path({"positions": np.array([request.start, other])}, request, 2)[-1].tolist() == other.tolist()


def test_no_path_is_a_valid_result() -> None:
    assert len(checked_path(unpack(pack(no_path(REQUEST))), REQUEST, 2)) == 0


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ({}, r"the result has the fields \[\]"),
        ({"positions": PATH.tolist()}, r"positions is a list; it must be an array of numbers of shape \(n, 3\)"),
        ({"positions": PATH[:, :2]}, r"positions has shape \(3, 2\)"),
        ({"positions": PATH[0]}, r"positions has shape \(3,\)"),
        ({"positions": PATH.astype(str)}, r"positions has shape \(3, 3\) and type <U"),
        ({"positions": changed(1, 0, np.nan)}, r"positions\[1\] is not finite"),
        ({"positions": np.vstack([PATH, PATH])}, "the path has 6 points; at most 3 are allowed"),
        ({"positions": changed(0, 1, 0.4)}, r"positions\[0\] has joint_2 at 0.4000, the start at 0.3000"),
        ({"positions": changed(2, 2, 0.4)}, r"positions\[-1\] has joint_3 at 0.4000, the nearest goal at -0.3000"),
        ({"positions": changed(1, 0, 2.6)}, r"positions\[1\] has joint_1 at 2.6000; it must be from -2.5000 to 2.5"),
    ],
)
def test_an_invalid_path_is_refused(message: dict[str, Any], fault: str) -> None:
    with pytest.raises(InvalidOutputError, match=fault):
        checked_path(message, REQUEST, 3)


def test_a_request_survives_its_encoding() -> None:
    request = path_requests()[1]
    decoded = PathRequest.from_message(unpack(pack(request)))
    assert pack(decoded) == pack(request)
    assert decoded.allowed_contacts == request.allowed_contacts
    assert decoded.obstacles[0].pose.tolist() == request.obstacles[0].pose.tolist()
