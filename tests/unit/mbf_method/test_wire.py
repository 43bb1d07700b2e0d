# SPDX-License-Identifier: BSD-3-Clause
"""Messages are msgpack with openpi-client's encoding of arrays; encoding and decoding preserve all values."""

from __future__ import annotations

import msgpack
import numpy as np
import pytest

from mbf_method import GraspRequest
from mbf_method.errors import InvalidOutputError
from mbf_method.wire import pack, unpack


def test_an_array_is_encoded_as_by_openpi_client() -> None:
    plain = msgpack.unpackb(pack({"a": np.array([[1], [2]], dtype=np.int16), "b": np.float32(0.5)}))
    assert plain == {
        "a": {b"__ndarray__": True, b"data": b"\x01\x00\x02\x00", b"dtype": "<i2", b"shape": [2, 1]},
        "b": {b"__npgeneric__": True, b"data": 0.5, b"dtype": "<f4"},
    }


def test_a_request_arrives_as_it_was_sent(box_request: GraspRequest) -> None:
    received = GraspRequest.from_message(unpack(pack(box_request)))
    assert (received.frame, received.seed, received.gripper) == ("world", 1, box_request.gripper)
    assert received.target.points.tolist() == box_request.target.points.tolist()
    assert received.target.triangles.dtype == np.int64
    assert received.robot.joint_names == ("j1",)
    received.target.points[0] = 0.0  # writable, as PyTorch expects


@pytest.mark.parametrize("value", [np.array([object()]), np.array([1j]), object()])
def test_a_value_without_an_encoding_is_refused(value: object) -> None:
    with pytest.raises(TypeError, match="has no encoding"):
        pack({"a": value})


@pytest.mark.parametrize(
    "data",
    [
        b"\xc1",
        b"",
        msgpack.packb([1]),
        msgpack.packb({b"__ndarray__": True, b"data": b"\x00", b"dtype": "<f8", b"shape": [1]}),
        msgpack.packb({b"__ndarray__": True, b"data": b"\x00", b"dtype": "O", b"shape": [1]}),
        msgpack.packb({b"__ndarray__": True}),
    ],
    ids=["no msgpack", "empty", "no dictionary", "too few bytes", "Python objects", "no shape"],
)
def test_bytes_that_are_no_message_are_refused(data: bytes) -> None:
    with pytest.raises(InvalidOutputError):
        unpack(data)
