# SPDX-License-Identifier: BSD-3-Clause
"""Publishes without switching threads for every subscriber.

rospy passes each message to one thread per subscriber and releases the interpreter lock for each thread. With direct
publishing, the simulation, which sends the clock to every node, takes a sixth less processor time. Python's
`socket.send` releases the lock even for a non-blocking socket, and reacquiring it takes as long as the system call.
"""

from __future__ import annotations

import ctypes
import socket
from typing import Any

import rospy.topics
from rospy.impl.tcpros_pubsub import QueuedConnection

# PyDLL keeps the interpreter lock during a call.
_send = ctypes.PyDLL(None).send
_send.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int]
_send.restype = ctypes.c_ssize_t
_FLAGS = socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL


def publish_directly() -> None:
    """Makes all publishers of this process send directly; call it before the first publisher has a subscriber."""
    rospy.topics.QueuedConnection = DirectConnection


class DirectConnection(QueuedConnection):  # type: ignore[misc]
    """A subscriber connection that immediately sends as much as the socket accepts, without blocking.

    The rest waits for rospy's thread of the connection, which discards the oldest messages as in rospy.

    Args:
        connection: Transport of rospy with a connected socket.
        queue_size: Maximum number of waiting messages; 0 for no limit.
    """

    def __init__(self, connection: Any, queue_size: int) -> None:
        self._begun = b""  # unsent part of a message
        self._thread_sends = False
        super().__init__(connection, queue_size)

    def write_data(self, data: bytes) -> bool:
        """Sends a message, or queues it.

        Raises:
            Exception: Error of the thread since the last call, upon which rospy closes the connection.
        """
        with self._lock:
            if self._error:
                error, self._error = self._error, None
                raise error
            sent = 0 if self._thread_sends or self._begun or self._queue else self._send(data)
            if sent == len(data):
                return True
            if sent:
                self._begun = data[sent:]
            else:
                if len(self._queue) == self._queue_size > 0:
                    del self._queue[0]
                self._queue.append(data)
            self._cond_data_available.notify()
        return True

    def _send(self, data: bytes) -> int:
        """Returns the number of bytes that the socket accepted; errors are left to the thread, where they recur."""
        client_socket = self._connection.socket
        sent = (
            max(0, _send(client_socket.fileno(), data, len(data), _FLAGS)) if client_socket is not None else 0
        )  # None: closed
        self._connection.stat_bytes += sent
        self._connection.stat_num_msg += sent == len(data)
        return sent

    def _run(self) -> None:
        while not self._connection.done:
            with self._lock:
                self._thread_sends = False
                while not (self._begun or self._queue or self._connection.done):
                    self._cond_data_available.wait()
                started, self._begun = self._begun, b""
                queue, self._queue = [started, *self._queue] if started else self._queue, []
                self._thread_sends = True
            for data in queue:
                try:
                    self._connection.write_data(data)
                except Exception as error:  # re-raised by the next write_data
                    with self._lock:
                        self._error = error
