# SPDX-License-Identifier: BSD-3-Clause
"""Serves the function of a method on the loopback interface."""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
import traceback
from dataclasses import dataclass
from typing import Any, Callable, Mapping, overload

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from mbf_method.actions import Actions
from mbf_method.grasp_request import GraspRequest
from mbf_method.grasps import Grasps
from mbf_method.joint_path import JointPath
from mbf_method.observation import Observation
from mbf_method.path_request import PathRequest
from mbf_method.source_digest import source_digest
from mbf_method.wire import PROTOCOL, VERSION, pack, unpack

PORT_VARIABLE = "MBF_METHOD_PORT"
"""Environment variable with the port that the framework chooses when it starts a method."""
DEFAULT_PORT = 8700
MAX_REQUEST_BYTES = 1 << 28
PARENT_PERIOD_S = 1.0
GRASPS, PATHS, ACTIONS = "grasps", "paths", "actions"
"""Kinds of methods."""

GraspFunction = Callable[[GraspRequest], Grasps]

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class ServedMethod:
    """Function of a method, for direct calls or for calls by the framework.

    Attributes:
        function: The function.
        kind: Kind of the method.
        read_request: Function that creates the argument of `function` from a decoded message.
        result_type: Class of the result.
        needs_camera: Whether requests must contain camera images.
    """

    function: Callable[[Any], Any]
    kind: str
    read_request: Callable[[Mapping[str, Any]], Any]
    result_type: type
    needs_camera: bool = False

    def __call__(self, request: Any) -> Any:
        """Calls the function and checks the class of its result.

        Args:
            request: Argument of the function.

        Raises:
            TypeError: The result has the wrong class.
        """
        result = self.function(request)
        if not isinstance(result, self.result_type):
            required = self.result_type.__name__
            raise TypeError(f"{self.function.__name__} returned a {type(result).__name__}; it must return {required}")
        return result

    @property
    def version(self) -> str:
        """Attribute `__version__` of the module with the function; "" without the attribute."""
        module = sys.modules.get(self.function.__module__)
        return str(getattr(module, "__version__", ""))

    def serve(self, port: int = DEFAULT_PORT, host: str = "127.0.0.1") -> None:
        """Serves the function until the process is interrupted.

        The method processes one request at a time. If the framework started this process, the framework also chose the
        port, and this process ends with the framework's process.

        Args:
            port: TCP port.
            host: Address to listen on; the default is reachable from this machine only.
        """
        if PORT_VARIABLE in os.environ:
            port = int(os.environ[PORT_VARIABLE])
            threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()
        handler = _Handler(self)
        with serve(
            handler.handle,
            host,
            port,
            origins=[None],  # refuses browsers, which always send an Origin header
            compression=None,
            max_size=MAX_REQUEST_BYTES,
        ) as server:
            print(f"{self.function.__name__} is served at ws://{host}:{port}", flush=True)
            try:
                server.serve_forever()
            except KeyboardInterrupt:
                os._exit(130)  # threads of open connections would keep the process alive


@overload
def grasp_method(function: GraspFunction) -> ServedMethod: ...
@overload
def grasp_method(*, camera: bool) -> Callable[[GraspFunction], ServedMethod]: ...
def grasp_method(
    function: GraspFunction | None = None, *, camera: bool = False
) -> ServedMethod | Callable[[GraspFunction], ServedMethod]:
    """Decorates a function that returns the grasps of an object; `ServedMethod.serve` serves the function.

    Args:
        function: Decorated function; None for a decorator with arguments.
        camera: Whether the function needs camera images.
    """

    def decorate(grasp_function: GraspFunction) -> ServedMethod:
        return ServedMethod(grasp_function, GRASPS, GraspRequest.from_message, Grasps, camera)

    return decorate if function is None else decorate(function)


def planner(function: Callable[[PathRequest], JointPath]) -> ServedMethod:
    """Decorates a function that returns a path to a goal; `ServedMethod.serve` serves the function."""
    return ServedMethod(function, PATHS, PathRequest.from_message, JointPath)


def policy(function: Callable[[Observation], Actions]) -> ServedMethod:
    """Decorates a function that returns a chunk of actions; `ServedMethod.serve` serves the function."""
    return ServedMethod(function, ACTIONS, Observation.from_message, Actions)


class _Handler:
    """Responds to the requests of all connections, one request at a time."""

    def __init__(self, method: ServedMethod) -> None:
        self._method = method
        self._turn = threading.Lock()

    def handle(self, connection: ServerConnection) -> None:
        try:
            connection.send(
                pack(
                    {
                        "protocol": PROTOCOL,
                        "version": VERSION,
                        "kind": self._method.kind,
                        "name": self._method.function.__name__,
                        "method_version": self._method.version,
                        "needs_camera": self._method.needs_camera,
                        "sources": source_digest(),
                    }
                )
            )
            for data in connection:
                connection.send(self._response(data, time.perf_counter()))
        except ConnectionClosed as closed:
            logger.warning("the connection was closed: %s", closed)

    def _response(self, data: str | bytes, received_s: float) -> str | bytes:
        """Returns the encoded result, or the traceback as text, like openpi's servers."""
        try:
            with self._turn:
                started_s = time.perf_counter()
                request = self._method.read_request(unpack(data.encode() if isinstance(data, str) else data))
                called_s, processor_s = time.perf_counter(), time.process_time()
                result = self._method(request)
                ended_s, processor_s = time.perf_counter(), time.process_time() - processor_s
            timing = {
                "infer_ms": 1e3 * (ended_s - called_s),
                "queue_ms": 1e3 * (started_s - received_s),
                "processor_ms": 1e3 * processor_s,
            }
            return pack({"result": result, "server_timing": timing})
        except Exception:  # any exception of the method becomes the response
            logger.exception("%s failed", self._method.function.__name__)
            return traceback.format_exc()


def _end_with_parent(parent: int) -> None:
    """Ends this process after the end of its parent, even while the method's function runs."""
    while os.getppid() == parent:
        time.sleep(PARENT_PERIOD_S)
    os._exit(1)
