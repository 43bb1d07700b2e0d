# SPDX-License-Identifier: BSD-3-Clause
"""Calls a method in another process, with limits of time and size."""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Iterator, Mapping

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.frames import CloseCode
from websockets.sync.client import ClientConnection, connect

from mbf_method.errors import (
    CallCancelledError,
    InvalidOutputError,
    MethodDiedError,
    MethodError,
    MethodLateError,
    MethodRaisedError,
    MethodStartError,
    MethodVersionError,
    TooLargeError,
)
from mbf_method.method_process import MethodProcess
from mbf_method.openpi import openpi_response
from mbf_method.wire import OPENPI, PROTOCOL, VERSION, pack, unpack

LOGGER = logging.getLogger("mbf_method")
RETRY_PERIOD_S = 0.05
CANCEL_PERIOD_S = 0.1
EXIT_TIMEOUT_S = 2.0
"""Maximum wait for the exit code after a process has closed its connection [s]."""


@dataclass(frozen=True)
class MethodSource:
    """Location of a method: either a command or an address must be set.

    Attributes:
        command: Program and arguments that start the method.
        address: Address of a running method, such as ws://127.0.0.1:8700.
        record_folder: Folder for copies of all requests, as inputs of `check_method`; "" for no copies.
        protocol: `mbf_method`, or `openpi` for a policy server at an address.
    """

    command: tuple[str, ...] = ()
    address: str = ""
    record_folder: str = ""
    protocol: str = PROTOCOL


@dataclass(frozen=True)
class MethodLimits:
    """Time and size limits of a method.

    Attributes:
        start_s: Maximum time from the start of the command until the method is ready [s].
        call_s: Maximum time of a call [s].
        result_bytes: Maximum size of a result [byte].
    """

    start_s: float = 60.0
    call_s: float = 30.0
    result_bytes: int = 1 << 24


@dataclass(frozen=True)
class CallTimes:
    """Durations of a call [s]; the sum of the first three is the time from the request to the result.

    Attributes:
        method_s: Duration of the method's function, measured in the method's process.
        queue_s: Wait for other requests, measured in the method's process.
        transport_s: Remaining time: encoding, transfer and decoding.
        processor_s: Processor time of the method's process during its function, without its children.
    """

    method_s: float
    queue_s: float
    transport_s: float
    processor_s: float


@dataclass(frozen=True)
class MethodResult:
    """Result of a call.

    Attributes:
        message: Unchecked fields of the result, keyed by name.
        times: Durations of the call.
    """

    message: Mapping[str, Any]
    times: CallTimes


class MethodClient:
    """Starts or connects to a method, and sends requests. After a fault, the next call starts or connects again.

    Attributes:
        source: Location of the method.
        sources: SHA-256 of the sources that the method's process has imported; known after `start`, "" if the method
            does not report them.
        said_name: Name that the method states about itself; known after `start`, "" if the method states none.
        said_version: Version that the method states about itself, likewise.
        needs_camera: Whether requests must contain camera images; known after `start`.

    Args:
        source: Location of the method.
        kind: Required kind of the method.
        limits: Time and size limits.
    """

    def __init__(self, source: MethodSource, kind: str, limits: MethodLimits) -> None:
        self.source = source
        self._kind = kind
        self._limits = limits
        self._process: MethodProcess | None = None
        self._connection: ClientConnection | None = None
        self.sources = self.said_name = self.said_version = ""
        self.needs_camera = False

    def start(self) -> None:
        """Starts the method or connects to its address; no effect while connected.

        Raises:
            MethodError: The method is not ready within its time limit, or its kind or version is wrong.
        """
        if self._connection is not None:
            return
        if bool(self.source.command) == bool(self.source.address):
            raise MethodStartError("the method needs either a command that starts it, or its address; set one of them")
        try:
            if self.source.command:
                self._process = MethodProcess(self.source.command)
            self._connection = self._connect(self._process.address if self._process else self.source.address)
        except Exception:
            self.close()
            raise

    def call(
        self, request: Any, limit_s: float | None = None, is_cancelled: Callable[[], bool] | None = None
    ) -> MethodResult:
        """Calls the method.

        Args:
            request: Dataclass with the inputs.
            limit_s: Maximum time of this call [s]; None for the limit of all calls.
            is_cancelled: Function, called regularly, that returns whether to end the call; None for never.

        Raises:
            MethodError: The method returns no result; the class of the error is the kind of fault.
            CallCancelledError: The call was cancelled; the next call starts or connects again.
        """
        self.start()
        started_s = time.perf_counter()
        encoded = pack(request)
        if self.source.record_folder:
            _record(encoded, Path(self.source.record_folder))
        data = self._exchange(encoded, self._limits.call_s if limit_s is None else limit_s, is_cancelled)
        if isinstance(data, str):
            if self.source.protocol == OPENPI:
                self.close()  # the server closes the connection after the text
            raise MethodRaisedError(
                f"the function of the method raised {data.strip().splitlines()[-1]}; its log has the traceback"
            )
        message = unpack(data)
        total_s = time.perf_counter() - started_s
        try:
            if self.source.protocol == OPENPI:
                message = openpi_response(message, total_s)
            timing = message["server_timing"]
            method_s, queue_s = (1e-3 * float(timing[name]) for name in ("infer_ms", "queue_ms"))
            processor_s = 1e-3 * float(timing.get("processor_ms", 0.0))
            result = dict(message["result"])
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidOutputError(
                f"the message of the method has no result with server_timing: {error!r}"
            ) from error
        transport_s = max(0.0, total_s - method_s - queue_s)
        return MethodResult(result, CallTimes(method_s, queue_s, transport_s, processor_s))

    def close(self) -> None:
        """Closes the connection, and ends the process that this client started."""
        connection, process = self._connection, self._process
        self._connection = self._process = None
        if connection is not None:
            _shut_down(connection)
        if process is not None:
            process.close()

    def _connect(self, address: str) -> ClientConnection:
        """Connects as soon as the method listens, and checks the kind and the version."""
        deadline_s = time.monotonic() + self._limits.start_s
        while True:
            left_s = max(RETRY_PERIOD_S, deadline_s - time.monotonic())
            try:
                connection = connect(
                    address,
                    open_timeout=left_s,
                    max_size=self._limits.result_bytes,
                    compression=None,
                    ping_interval=None,
                    close_timeout=EXIT_TIMEOUT_S,
                    proxy=None,
                )
                break
            except (OSError, InvalidHandshake, InvalidURI) as error:
                if self._process is not None and (ended := self._process.end_text()):
                    raise MethodStartError(f"{ended} before the method was ready; its output is in the log") from error
                if not isinstance(error, OSError):
                    raise MethodStartError(f"{address} is not the address of a method: {error}") from error
                if time.monotonic() > deadline_s:
                    raise MethodStartError(
                        f"the method at {address} was not ready within {self._limits.start_s:g} s: {error}"
                    ) from error
                time.sleep(RETRY_PERIOD_S)
        try:
            self._check_greeting(address, connection.recv(timeout=left_s))
        except (ConnectionClosed, TimeoutError, MethodError) as error:
            _shut_down(connection)
            if isinstance(error, MethodError):
                raise
            raise MethodStartError(f"the server at {address} does not state its method: {error}") from error
        return connection

    def _check_greeting(self, address: str, data: Any) -> None:
        greeting = unpack(data) if isinstance(data, bytes) else {}
        self.said_name, self.said_version = (str(greeting.get(key, "")) for key in ("name", "method_version"))
        if self.source.protocol == OPENPI:
            if not isinstance(data, bytes) or greeting.get("protocol") == PROTOCOL:
                raise MethodVersionError(
                    f"the server at {address} is no openpi server; for a method of mbf_method, leave out openpi_keys"
                )
            return
        found = [greeting.get(name) for name in ("protocol", "version", "kind")]
        if found != [PROTOCOL, VERSION, self._kind]:
            raise MethodVersionError(
                f"the server at {address} says protocol {found[0]!r}, version {found[1]!r}, kind {found[2]!r}; "
                f"required: {PROTOCOL!r}, {VERSION}, {self._kind!r}; install the package mbf_method of this framework"
            )
        self.sources = str(greeting.get("sources", ""))
        self.needs_camera = bool(greeting.get("needs_camera"))

    def _exchange(self, request: bytes, limit_s: float, is_cancelled: Callable[[], bool] | None) -> Any:
        """Sends a request and returns the response; closes the connection and the process on failure."""
        assert self._connection is not None
        try:
            with _deadline(self._connection, limit_s) as expired:
                self._connection.send(request)
                return _response(self._connection, is_cancelled)
        except CallCancelledError:
            self.close()
            raise
        except ConnectionClosed as closed:
            ended = self._process.end_text(EXIT_TIMEOUT_S) if self._process and not expired.is_set() else ""
            self.close()
            if expired.is_set():
                raise MethodLateError(f"the method returned no result within {limit_s:.3g} s") from closed
            if closed.sent is not None and closed.sent.code == CloseCode.MESSAGE_TOO_BIG:
                raise TooLargeError(
                    f"the result is larger than {self._limits.result_bytes} bytes: {closed.sent.reason}"
                ) from closed
            if closed.rcvd is not None and closed.rcvd.code == CloseCode.MESSAGE_TOO_BIG:
                raise TooLargeError(f"the request of {len(request)} bytes is larger than allowed") from closed
            raise MethodDiedError(f"the method died: {ended or f'the connection was closed ({closed})'}") from closed


def _response(connection: ClientConnection, is_cancelled: Callable[[], bool] | None) -> Any:
    """Waits for a response; raises CallCancelledError as soon as the call is cancelled."""
    while is_cancelled is not None:
        try:
            return connection.recv(timeout=CANCEL_PERIOD_S)
        except TimeoutError as error:
            if is_cancelled():
                raise CallCancelledError("the call was cancelled") from error
    return connection.recv()


def _record(request: bytes, folder: Path) -> None:
    """Writes an encoded request to a new file in a folder; names are in the order of the calls. Logs a failure."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{time.time_ns()}_{os.getpid()}.msgpack").write_bytes(request)
    except OSError as error:
        LOGGER.warning("a request is not recorded: %s", error)


@contextmanager
def _deadline(connection: ClientConnection, limit_s: float) -> Iterator[threading.Event]:
    """Shuts down a connection after a time limit and sets the event; the shutdown ends waits in `send` and `recv`."""
    expired = threading.Event()

    def expire() -> None:
        expired.set()
        _shut_down(connection)

    timer = threading.Timer(limit_s, expire)
    timer.daemon = True
    timer.start()
    try:
        yield expired
    finally:
        timer.cancel()


def _shut_down(connection: ClientConnection) -> None:
    """Ends a connection without the closing handshake, because a hanging method would not respond."""
    with suppress(OSError):
        connection.socket.shutdown(socket.SHUT_RDWR)
