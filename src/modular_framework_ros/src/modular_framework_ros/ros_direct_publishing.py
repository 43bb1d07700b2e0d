# SPDX-License-Identifier: BSD-3-Clause
"""Publishes without a change of threads for every subscriber.

rospy hands each message to a thread of its own per subscriber, and gives up the interpreter for each of them. The
simulation, whose clock goes to every node, takes a sixth less processor time without that. Python's `socket.send` gives
up the interpreter too, also where it does not wait, and getting it back takes as long as the system call.
"""

from __future__ import annotations

import ctypes
import socket
from typing import Any

import rospy.topics
from rospy.impl.tcpros_pubsub import QueuedConnection

# of a library whose functions are called without giving up the interpreter
_send = ctypes.PyDLL(None).send
_send.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int]
_send.restype = ctypes.c_ssize_t
_FLAGS = socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL


def publish_directly() -> None:
    """Makes all publishers of this process send at once; to be called before the first one has a subscriber."""
    rospy.topics.QueuedConnection = DirectConnection


class DirectConnection(QueuedConnection):  # type: ignore[misc]
    """A connection to a subscriber that sends at once what the socket takes, and never waits for it.

    What the socket does not take waits for rospy's thread of the connection, the oldest messages dropped, as before.

    Args:
        connection: Transport of rospy with a connected socket.
        queue_size: Messages that may wait; 0: any number.
    """

    def __init__(self, connection: Any, queue_size: int) -> None:
        self._begun = b""  # rest of a message whose first bytes are sent
        self._thread_sends = False
        super().__init__(connection, queue_size)

    def write_data(self, data: bytes) -> bool:
        """Sends a message, or queues it.

        Raises:
            Exception: What the thread met since the last call; rospy closes the connection then.
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
        """Returns how many bytes the socket took; errors are left to the thread, which meets them again."""
        near = self._connection.socket
        sent = max(0, _send(near.fileno(), data, len(data), _FLAGS)) if near is not None else 0  # None: closed
        self._connection.stat_bytes += sent
        self._connection.stat_num_msg += sent == len(data)
        return sent

    def _run(self) -> None:
        while not self._connection.done:
            with self._lock:
                self._thread_sends = False
                while not (self._begun or self._queue or self._connection.done):
                    self._cond_data_available.wait()
                begun, self._begun = self._begun, b""
                queue, self._queue = [begun, *self._queue] if begun else self._queue, []
                self._thread_sends = True
            for data in queue:
                try:
                    self._connection.write_data(data)
                except Exception as error:  # raised by the next write_data
                    with self._lock:
                        self._error = error
