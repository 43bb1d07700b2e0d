# SPDX-License-Identifier: BSD-3-Clause
"""Measures how late the states of an arm come, over a connection of its own, and checks that the arm speaks RTDE."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections import deque

PORT = 30004
_HEADER = struct.Struct(">HB")
_PROTOCOL, _VERSION = ord("V"), ord("v")
_OLDEST = (3, 4)
_PATIENCE_S = 2.0  # for an answer
_PERIOD_S = 1.0  # between two questions
_WINDOW = 250  # states whose ages are compared


class ConnectionEndedError(Exception):
    """The connection to the arm has failed; the text says why."""


class DelayWatch:
    """The time an arm's controller takes to answer, and how much later than usual its states come.

    Args:
        address: of the controller.

    Raises:
        ConnectionEndedError: nothing answers, or not with a version that can be used.
    """

    def __init__(self, address: str) -> None:
        self._answers_s: deque[float] = deque(maxlen=2)
        self._ages_s: deque[float] = deque(maxlen=_WINDOW)
        self._where = f"{address}:{PORT}"
        try:
            self._socket = socket.create_connection((address, PORT), _PATIENCE_S)
            accepted, version = self._ask(_PROTOCOL, b"\0\2"), self._ask(_VERSION)
        except OSError as error:
            raise ConnectionEndedError(f"Could not connect to {self._where}: {error}; verify the address") from error
        if accepted != b"\1":
            raise ConnectionEndedError(f"{self._where} refuses RTDE protocol 2; is it a controller of at least 3.4?")
        software = struct.unpack(">4I", version) if len(version) == 16 else (0, 0, 0, 0)
        if software[:2] < _OLDEST:
            raise ConnectionEndedError(
                f"{self._where} has software {'.'.join(map(str, software[:3]))}; at least 3.4 is needed, update it"
            )

    def _ask(self, kind: int, payload: bytes = b"") -> bytes:
        """Returns the payload of the answer to a request."""
        begun_s = time.monotonic()
        self._socket.sendall(_HEADER.pack(_HEADER.size + len(payload), kind) + payload)
        answer = self._socket.recv(64)
        if not answer:
            raise OSError("the connection was closed")
        self._answers_s.append(time.monotonic() - begun_s)
        return answer[_HEADER.size :]

    def start(self) -> None:
        """Begins to ask again and again, on a thread, as long as there are answers."""
        threading.Thread(target=self._ask_again, name="delay", daemon=True).start()

    def _ask_again(self) -> None:
        try:
            while True:
                time.sleep(_PERIOD_S)
                self._ask(_VERSION)
        except OSError:
            return  # what reads the states notices a link that is lost

    def refuse_beyond(self, longest_s: float) -> None:
        """Checks the time of the answers.

        Raises:
            ConnectionEndedError: they take longer than `longest_s` [s].
        """
        if min(self._answers_s) > longest_s:
            raise ConnectionEndedError(
                f"the answers of the arm come {min(self._answers_s):.2f} s late, longer than link_timeout "
                f"({longest_s:g} s); check the network"
            )

    def update(self, age_s: float) -> float:
        """Takes the age of a state, by clocks that differ [s]; returns how late it is [s]."""
        self._ages_s.append(age_s)
        return max(min(self._answers_s), age_s - min(self._ages_s))
