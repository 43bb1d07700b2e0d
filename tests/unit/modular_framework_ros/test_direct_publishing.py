# SPDX-License-Identifier: BSD-3-Clause
"""A publisher that sends at once: in order and whole, and never waits for a subscriber that does not read."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator

import pytest
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSPub
from std_msgs.msg import String

from modular_framework_ros.connections.ros_direct_publishing import DirectConnection

MESSAGES = [f"{number:06d}".encode() * 500 for number in range(400)]


class Link:
    """A connection and the other end of its socket."""

    def __init__(self, queue_size: int) -> None:
        near, self.far = socket.socketpair()
        near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 8192)
        self.transport = TCPROSTransport(TCPROSPub("/topic", String), "/topic")
        self.transport.set_socket(near, "/subscriber")
        self.connection = DirectConnection(self.transport, queue_size)

    def read_all(self, until: bytes) -> bytes:
        received = b""
        self.far.settimeout(10.0)
        while not received.endswith(until):
            received += self.far.recv(65536)
        return received

    def close(self) -> None:
        self.far.close()
        self.transport.close()


@pytest.fixture
def link(request: pytest.FixtureRequest) -> Iterator[Link]:
    made = Link(getattr(request, "param", 0))
    yield made
    made.close()


def test_a_subscriber_that_reads_gets_each_message_before_the_call_returns(link: Link) -> None:
    for message in MESSAGES[:50]:
        link.connection.write_data(message)
        link.far.setblocking(False)
        assert link.far.recv(65536) == message
    assert (link.transport.stat_num_msg, link.transport.stat_bytes) == (50, 50 * len(MESSAGES[0]))


def test_messages_that_the_socket_does_not_take_at_once_come_whole_and_in_order(link: Link) -> None:
    received: list[bytes] = []
    reader = threading.Thread(target=lambda: received.append(link.read_all(MESSAGES[-1])))
    for number, message in enumerate(MESSAGES):
        link.connection.write_data(message)
        if number == 100:  # by now messages wait
            reader.start()
    reader.join()
    assert received == [b"".join(MESSAGES)]


@pytest.mark.parametrize("link", [5], indirect=True)
def test_a_subscriber_that_does_not_read_loses_the_oldest_and_never_makes_the_publisher_wait(link: Link) -> None:
    begun = time.monotonic()
    for message in MESSAGES:
        link.connection.write_data(message)
    assert time.monotonic() - begun < 1.0
    received = link.read_all(MESSAGES[-1])
    size = len(MESSAGES[0])
    whole = [received[at : at + size] for at in range(0, len(received), size)]
    numbers = [MESSAGES.index(message) for message in whole]  # a message that was cut is not in the list
    assert numbers == sorted(set(numbers)) and numbers[0] == 0 and numbers[-5:] == [395, 396, 397, 398, 399]
    assert len(numbers) < len(MESSAGES)


def test_a_subscriber_that_is_gone_is_an_error_of_a_later_call(link: Link) -> None:
    link.far.close()
    with pytest.raises(Exception, match=r"Broken pipe|not successfully|closed"):
        for _ in range(200):
            link.connection.write_data(MESSAGES[0])
            time.sleep(0.01)
