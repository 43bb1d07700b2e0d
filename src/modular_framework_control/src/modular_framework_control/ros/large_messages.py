# SPDX-License-Identifier: BSD-3-Clause
"""Receives large messages in pieces, so that the control loop never waits long for Python's interpreter.

rospy copies a received message in one call, which holds the interpreter for many milliseconds if the message is large.
"""

from __future__ import annotations

import ctypes
import io
import mmap
import time
from typing import Any

import rospy.impl.tcpros_base

_PIECE = 1 << 16  # bytes
_SLICES = 2000
_PAUSE_S = 2e-4
_M_MMAP_THRESHOLD = -3


class _LargeMessage(mmap.mmap):
    """The bytes of a message; whoever takes many slices, to deserialise it, pauses now and then (see `parts`)."""

    _taken = 0

    def __getitem__(self, key: Any) -> Any:
        self._taken += 1
        if self._taken % _SLICES == 0:
            time.sleep(_PAUSE_S)
        return super().__getitem__(key)


class PiecewiseBuffer(io.BytesIO):
    """The buffer of a connection, whose large messages are copied in pieces."""

    def read(self, size: int | None = -1) -> Any:
        """Returns `size` bytes; of many bytes, an object that is sliced like bytes."""
        if size is None or size <= _PIECE:
            return super().read(size)
        message = _LargeMessage(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        for begin in range(0, size, _PIECE):
            message.write(super().read(min(_PIECE, size - begin)))
        return message


def receive_in_pieces() -> None:
    """Makes all later connections of this process receive large messages in pieces.

    Their buffers grow without being copied, because the C library always maps large blocks.
    """
    ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, _PIECE)
    rospy.impl.tcpros_base.BytesIO = PiecewiseBuffer
