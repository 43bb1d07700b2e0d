# SPDX-License-Identifier: BSD-3-Clause
"""Receives large messages in pieces, so that the control loop never waits long for Python's interpreter.

rospy copies a received message, and frees its buffer, in single calls that hold the interpreter for milliseconds if the
message is large.
"""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Iterator
from typing import Any

from rospy.impl.tcpros_base import TCPROSTransport

_PIECE = 1 << 16  # bytes
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_KEPT_BYTES = 64 << 20
_MAPPED_BYTES = 1 << 20


class ReceiveBuffer:
    """What a connection has received, in the pieces in which that came; in place of rospy's BytesIO."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []
        self._size = self._position = 0

    def tell(self) -> int:
        """Returns the position [bytes]."""
        return self._position

    def seek(self, position: int) -> None:
        """Sets the position [bytes]."""
        self._position = position

    def write(self, data: bytes) -> None:
        """Puts `data` at the position; what was behind that is dropped."""
        self.truncate(self._position)
        self._pieces.append(bytes(data))
        self._position = self._size = self._size + len(data)

    def truncate(self, size: int) -> None:
        """Drops all but the first `size` bytes."""
        while self._size > size:
            piece = self._pieces.pop()
            self._size -= len(piece)
            if self._size < size:
                self._pieces.append(piece[: size - self._size])
                self._size = size

    def read(self, size: int) -> Any:
        """Returns the next `size` bytes; of many bytes, a map of memory that is sliced like bytes."""
        begin, self._position = self._position, min(self._position + size, self._size)
        if self._position - begin <= _PIECE:
            return b"".join(self._parts(begin, self._position))
        message = mmap.mmap(-1, self._position - begin, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        for part in self._parts(begin, self._position):
            message.write(part)
        return message

    def getvalue(self) -> bytes:
        """Returns all bytes."""
        return b"".join(self._pieces)

    def _parts(self, begin: int, end: int) -> Iterator[bytes]:
        offset = 0
        for piece in self._pieces:
            if offset >= end:
                return
            if offset + len(piece) > begin:
                yield piece[max(0, begin - offset) : end - offset]
            offset += len(piece)


def receive_in_pieces() -> None:
    """Makes all later connections of this process receive large messages in pieces.

    The C library keeps the memory of the pieces: to give memory back interrupts all processors that run the process.
    """
    library = ctypes.CDLL(None)
    library.mallopt(_M_MMAP_THRESHOLD, _MAPPED_BYTES)
    library.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)
    initialise = TCPROSTransport.__init__

    def initialise_with_pieces(transport: Any, *arguments: Any, **fields: Any) -> None:
        initialise(transport, *arguments, **fields)
        transport.read_buff = ReceiveBuffer()

    TCPROSTransport.__init__ = initialise_with_pieces
