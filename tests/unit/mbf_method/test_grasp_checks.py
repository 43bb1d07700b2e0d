# SPDX-License-Identifier: BSD-3-Clause
"""Invalid names, shapes, values, frames and counts in the result of a method are found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mbf_method import GraspRequest
from mbf_method.errors import InvalidOutputError
from mbf_method.grasps import checked_grasps


def result(**changes: Any) -> dict[str, Any]:
    """Returns two valid grasps with some fields replaced."""
    poses, halves = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1)), np.full(2, 0.5)
    return {"frame": "world", "poses": poses, "scores": halves, "widths": halves / 10, **changes}


def changed(array: np.ndarray, index: tuple[int, ...], value: float) -> np.ndarray:
    """Returns a copy of an array with another value at an index."""
    copy = array.copy()
    copy[index] = value
    return copy


POSES, SCORES = result()["poses"], result()["scores"]


def test_a_valid_result_becomes_grasps_in_double_precision(box_request: GraspRequest) -> None:
    grasps = checked_grasps(result(), box_request, 2)
    assert grasps.poses.dtype == np.float64
    assert grasps.scores.tolist() == [0.5, 0.5]


def test_no_grasp_is_a_valid_result(box_request: GraspRequest) -> None:
    empty = result(poses=np.zeros((0, 4, 4)), scores=np.zeros(0), widths=np.zeros(0))
    assert len(checked_grasps(empty, box_request, 2).scores) == 0


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ({"poses": POSES}, r"the result has the fields \['poses'\]"),
        (result(frame="camera"), "are in frame 'camera'; the frame must be 'world'"),
        (result(poses=POSES.tolist()), r"poses is a list; it must be an array of numbers of shape \(n, 4, 4\)"),
        (result(poses=POSES[:1]), r"have the lengths \[1, 2, 2\]"),
        (result(poses=POSES[:, :3]), r"poses has shape \(2, 3, 4\)"),
        (result(scores=SCORES[:, None]), r"^scores has shape \(2, 1\) and type float64; .* shape \(n,\)$"),
        (result(scores=np.array(["a", "b"])), "scores has shape .* and type <U1"),
        (result(scores=changed(SCORES, (1,), np.nan)), r"scores\[1\] is not finite"),
        (result(poses=changed(POSES, (1, 0, 3), np.inf)), r"poses\[1\] is not finite"),
        (result(scores=changed(SCORES, (0,), 1.5)), r"scores\[0\] is 1.5; it must be from 0 to 1"),
        (result(widths=np.array([0.04, 40.0])), r"widths\[1\] is 40; it must be from 0 to 0.1"),
        (result(poses=changed(POSES, (1, 2, 2), -1.0)), r"poses\[1\] is no rigid transform"),
        (result(poses=changed(POSES, (0, 3, 0), 0.1)), r"poses\[0\] is no rigid transform"),
        (
            result(poses=np.tile(np.eye(4), (3, 1, 1)), scores=np.full(3, 0.5), widths=np.full(3, 0.05)),
            "there are 3 grasps; at most 2 are allowed",
        ),
    ],
)
def test_an_invalid_result_is_refused(box_request: GraspRequest, message: dict[str, Any], fault: str) -> None:
    with pytest.raises(InvalidOutputError, match=fault):
        checked_grasps(message, box_request, 2)
