# SPDX-License-Identifier: BSD-3-Clause
"""Serves the ports of the emulated controller, with injected network faults."""

from __future__ import annotations

import logging
import random
import selectors
import socket
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

LOGGER = logging.getLogger("rosout.ur_emulator")
_HEADER_BYTES = 4  # length, type and recipe of a data package
_MAX_QUEUED_PACKAGES = 2_000  # maximum number of packages that wait for a client


@dataclass(slots=True)
class NetworkFaults:
    """Injected faults of the network.

    Attributes:
        frozen: Whether no data is transmitted in either direction while the connections stay open.
        delay_s: Delay of all data sent by the controller [s].
        lose_every: n, if every n-th data package is lost; 0 for no losses.
        corrupt_every: n, if every n-th data package has flipped bits; 0 for no flipped bits.
    """

    frozen: bool = False
    delay_s: float = 0.0
    lose_every: int = 0
    corrupt_every: int = 0


class Session:
    """Callbacks for one connection; a ValueError in a callback closes the connection.

    Args:
        receive: Returns the response to received bytes.
        cycle: Returns the data to send in each cycle.
        close: Called after the connection was closed.
        greeting: Data that is sent after the connection was accepted.
    """

    def __init__(
        self,
        receive: Callable[[bytes], bytes],
        cycle: Callable[[], bytes] | None = None,
        close: Callable[[], None] | None = None,
        greeting: bytes = b"",
    ) -> None:
        self.receive = receive
        self.cycle = cycle
        self.close = close
        self.greeting = greeting


class _Connection:
    """Connection with its queue of data, by the time to send."""

    __slots__ = ("socket", "session", "waiting", "packages")

    def __init__(self, connection: socket.socket, session: Session) -> None:
        self.socket = connection
        self.session = session
        self.waiting: deque[tuple[float, bytes]] = deque()
        self.packages = 0


class PortServer:
    """Serves all ports and connections of the controller on the caller's thread without blocking.

    Args:
        address: IP address of the ports.
        ports: Factories of the session of a new connection, by port.

    Attributes:
        faults: Current faults of the network.
    """

    def __init__(self, address: str, ports: Mapping[int, Callable[[], Session]]) -> None:
        self.faults = NetworkFaults()
        self._address = address
        self._ports = dict(ports)
        self._selector = selectors.DefaultSelector()
        self._listeners: list[socket.socket] = []
        self._connections: list[_Connection] = []

    def connect(self) -> None:
        """Opens all ports, unless the ports are already open.

        Raises:
            OSError: A port is in use; the text names the port.
        """
        if self._listeners:
            return
        for port, make_session in self._ports.items():
            listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setblocking(False)
            self._listeners.append(listener)
            try:
                listener.bind((self._address, port))
            except OSError as error:
                self.close()
                raise OSError(
                    error.errno,
                    f"port {self._address}:{port}: {error.strerror}; stop the program that uses the port, or "
                    "choose another address, for example 127.0.0.2",
                ) from error
            listener.listen()
            self._selector.register(listener, selectors.EVENT_READ, make_session)

    def close(self) -> None:
        """Closes all connections and ports; may be called twice."""
        for connection in list(self._connections):
            self._close_connection(connection)
        while self._listeners:
            listener = self._listeners.pop()
            if listener in self._selector.get_map():
                self._selector.unregister(listener)
            listener.close()

    def wait(self, timeout_s: float) -> list[selectors.SelectorKey]:
        """Returns the sockets with data to read, after at most `timeout_s` [s]."""
        return [key for key, _ in self._selector.select(max(0.0, timeout_s))]

    def serve(self, ready: list[selectors.SelectorKey], now_s: float) -> None:
        """Handles received data."""
        if self.faults.frozen:
            return
        for key in ready:
            if isinstance(key.data, _Connection):
                self._read(key.data, now_s)
            elif key.fileobj in self._listeners:
                self._accept(key, now_s)

    def cycle(self, now_s: float) -> None:
        """Sends the data of each session for this cycle, and delayed data that is due."""
        for connection in list(self._connections):
            if connection.session.cycle is not None:
                package = connection.session.cycle()
                if package:
                    connection.packages += 1
                    lost = self.faults.lose_every and connection.packages % self.faults.lose_every == 0
                    if self.faults.corrupt_every and connection.packages % self.faults.corrupt_every == 0:
                        package = _with_flipped_bits(package)
                    if not lost:
                        self._queue(connection, package, now_s)
            self._flush(connection, now_s)

    def send_to_all(self, data: bytes, now_s: float) -> None:
        """Sends bytes to every client that receives data packages."""
        for connection in list(self._connections):
            if connection.session.cycle is not None:
                self._queue(connection, data, now_s)
                self._flush(connection, now_s)

    @property
    def connections(self) -> int:
        """Returns the number of open connections."""
        return len(self._connections)

    def _accept(self, key: selectors.SelectorKey, now_s: float) -> None:
        accepted, _ = key.fileobj.accept()  # type: ignore[union-attr]
        accepted.setblocking(False)
        accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection = _Connection(accepted, key.data())
        self._connections.append(connection)
        self._selector.register(accepted, selectors.EVENT_READ, connection)
        if connection.session.greeting:
            self._queue(connection, connection.session.greeting, now_s)
            self._flush(connection, now_s)

    def _read(self, connection: _Connection, now_s: float) -> None:
        try:
            data = connection.socket.recv(65536)
            reply = connection.session.receive(data) if data else b""
        except BlockingIOError:
            return
        except ValueError as error:
            LOGGER.warning("closed a connection: %s", error)
            self._close_connection(connection)
            return
        except OSError:
            data = b""
        if not data:
            self._close_connection(connection)
        elif reply:
            self._queue(connection, reply, now_s)
            self._flush(connection, now_s)

    def _queue(self, connection: _Connection, data: bytes, now_s: float) -> None:
        if len(connection.waiting) < _MAX_QUEUED_PACKAGES:
            connection.waiting.append((now_s + self.faults.delay_s, data))

    def _flush(self, connection: _Connection, now_s: float) -> None:
        while connection.waiting and not self.faults.frozen and connection.waiting[0][0] <= now_s:
            due_s, data = connection.waiting.popleft()
            try:
                sent = connection.socket.send(data)
            except BlockingIOError:
                sent = 0
            except OSError:
                self._close_connection(connection)
                return
            if sent < len(data):
                connection.waiting.appendleft((due_s, data[sent:]))
                return

    def _close_connection(self, connection: _Connection) -> None:
        if connection not in self._connections:
            return
        self._connections.remove(connection)
        self._selector.unregister(connection.socket)
        connection.socket.close()
        if connection.session.close is not None:
            connection.session.close()


def _with_flipped_bits(package: bytes) -> bytes:
    """Returns the package with a random flipped bit in each 8 bytes after the header."""
    damaged = bytearray(package)
    for start in range(_HEADER_BYTES, len(package), 8):
        damaged[random.randrange(start, min(start + 8, len(package)))] ^= 1 << random.randrange(8)
    return bytes(damaged)
