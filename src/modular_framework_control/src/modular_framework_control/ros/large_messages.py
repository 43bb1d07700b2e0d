# SPDX-License-Identifier: BSD-3-Clause
"""Receives large messages in chunks, so that the control loop never waits long for Python's interpreter lock.

rospy copies a received message and frees its buffer in single calls, which hold the interpreter lock for milliseconds
if the message is large.
"""

from __future__ import annotations

import ctypes
import mmap
import socket
from collections.abc import Iterator
from typing import Any

from rospy.impl.tcpros_base import TCPROSTransport

_PIECE_BYTES = 1 << 16  # bytes
_QUEUE_BYTES = 1 << 17  # of received data in the kernel, per connection
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_TRIM_THRESHOLD_BYTES = 64 << 20
_MMAP_THRESHOLD_BYTES = 1 << 20


class ReceiveBuffer:
    """Stores the received bytes of a connection in chunks; replaces rospy's BytesIO."""

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
        """Writes `data` at the position and drops all bytes after the position."""
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
        """Returns the next `size` bytes; above 64 KiB, as a memory map that can be sliced like bytes."""
        begin, self._position = self._position, min(self._position + size, self._size)
        if self._position - begin <= _PIECE_BYTES:
            return b"".join(self._pieces_between(begin, self._position))
        message = mmap.mmap(-1, self._position - begin, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        for part in self._pieces_between(begin, self._position):
            message.write(part)
        return message

    def getvalue(self) -> bytes:
        """Returns all bytes."""
        return b"".join(self._pieces)

    def _pieces_between(self, begin: int, end: int) -> Iterator[bytes]:
        offset = 0
        for piece in self._pieces:
            if offset >= end:
                return
            if offset + len(piece) > begin:
                yield piece[max(0, begin - offset) : end - offset]
            offset += len(piece)


def receive_in_pieces() -> None:
    """Makes all later connections of this process receive large messages in chunks.

    The C library keeps the freed memory: returning it to the system would interrupt every processor of the process.
    The receive queue of a connection is short: a kernel without preemption copies all that fits into the queue at once,
    and meanwhile runs nothing else on that processor, not even a thread with real-time priority.
    """
    library = ctypes.CDLL(None)
    library.mallopt(_M_MMAP_THRESHOLD, _MMAP_THRESHOLD_BYTES)
    library.mallopt(_M_TRIM_THRESHOLD, _TRIM_THRESHOLD_BYTES)
    initialise, connect = TCPROSTransport.__init__, TCPROSTransport.connect

    def initialise_with_pieces(transport: Any, *arguments: Any, **fields: Any) -> None:
        initialise(transport, *arguments, **fields)
        transport.read_buff = ReceiveBuffer()

    def connect_with_short_queue(transport: Any, *arguments: Any, **fields: Any) -> None:
        connect(transport, *arguments, **fields)
        transport.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _QUEUE_BYTES)

    TCPROSTransport.__init__ = initialise_with_pieces
    TCPROSTransport.connect = connect_with_short_queue
