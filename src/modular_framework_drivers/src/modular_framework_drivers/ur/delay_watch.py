# SPDX-License-Identifier: BSD-3-Clause
"""Measures the delay of the states of an arm over a separate connection, and checks the arm's RTDE version."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections import deque

PORT = 30004
_HEADER = struct.Struct(">HB")
_PROTOCOL, _VERSION = ord("V"), ord("v")
_MIN_VERSION = (3, 4)
_PATIENCE_S = 2.0  # response timeout
_PERIOD_S = 1.0  # request period
_WINDOW = 250  # number of compared state ages


class ConnectionEndedError(Exception):
    """Raised if the connection to the arm has failed; the text gives the cause."""


class DelayWatch:
    """Measures the response time of an arm's controller and the delay of its states.

    Args:
        address: Address of the controller.

    Raises:
        ConnectionEndedError: If the controller does not respond or has an unsupported version.
    """

    def __init__(self, address: str) -> None:
        self._response_times_s: deque[float] = deque(maxlen=2)
        self._ages_s: deque[float] = deque(maxlen=_WINDOW)
        self._where = f"{address}:{PORT}"
        try:
            self._socket = socket.create_connection((address, PORT), _PATIENCE_S)
            accepted, version = self._request(_PROTOCOL, b"\0\2"), self._request(_VERSION)
        except OSError as error:
            raise ConnectionEndedError(f"Could not connect to {self._where}: {error}; verify the address") from error
        if accepted != b"\1":
            raise ConnectionEndedError(f"{self._where} refuses RTDE protocol 2; is it a controller of at least 3.4?")
        software = struct.unpack(">4I", version) if len(version) == 16 else (0, 0, 0, 0)
        if software[:2] < _MIN_VERSION:
            raise ConnectionEndedError(
                f"{self._where} has software {'.'.join(map(str, software[:3]))}; at least 3.4 is needed, update it"
            )

    def _request(self, request_type: int, payload: bytes = b"") -> bytes:
        """Returns the payload of the response to a request."""
        begun_s = time.monotonic()
        self._socket.sendall(_HEADER.pack(_HEADER.size + len(payload), request_type) + payload)
        response = self._socket.recv(64)
        if not response:
            raise OSError("the connection was closed")
        self._response_times_s.append(time.monotonic() - begun_s)
        return response[_HEADER.size :]

    def start(self) -> None:
        """Starts a thread that sends requests periodically until a response fails to arrive."""
        threading.Thread(target=self._request_periodically, name="delay", daemon=True).start()

    def _request_periodically(self) -> None:
        try:
            while True:
                time.sleep(_PERIOD_S)
                self._request(_VERSION)
        except OSError:
            return  # the reader of the states detects a lost connection

    def check_delay(self, max_delay_s: float) -> None:
        """Checks the response times.

        Raises:
            ConnectionEndedError: If responses take longer than `max_delay_s` [s].
        """
        if min(self._response_times_s) > max_delay_s:
            raise ConnectionEndedError(
                f"the answers of the arm come {min(self._response_times_s):.2f} s late, longer than link_timeout "
                f"({max_delay_s:g} s); check the network"
            )

    def update(self, age_s: float) -> float:
        """Records the age of a state, whose clocks may have an offset [s]; returns the delay of the state [s]."""
        self._ages_s.append(age_s)
        return max(min(self._response_times_s), age_s - min(self._ages_s))
