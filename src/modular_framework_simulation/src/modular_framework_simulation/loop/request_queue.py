# SPDX-License-Identifier: BSD-3-Clause
"""Runs work of any thread in the simulation loop, because only one thread may use the physics engine."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

from modular_framework_simulation.errors import LoopTimeoutError

T = TypeVar("T")


class _Request:
    def __init__(self, function: Callable[[], Any]) -> None:
        self.function = function
        self.done = threading.Event()
        self.result: Any = None
        self.error: Exception | None = None
        self.lock = threading.Lock()
        self.abandoned = False
        self.started = False

    def run(self) -> None:
        with self.lock:
            if self.abandoned:
                return
            self.started = True
        try:
            self.result = self.function()
        except Exception as error:  # raised in the thread of the caller
            self.error = error
        self.done.set()


class RequestQueue:
    """Requests of other threads, executed between physics steps in the order of arrival."""

    def __init__(self) -> None:
        self._requests: queue.SimpleQueue[_Request] = queue.SimpleQueue()
        self._arrived = threading.Event()

    def call(self, name: str, function: Callable[[], T], timeout_s: float) -> T:
        """Runs work in the loop's thread and waits for the result.

        Args:
            name: Name of the work for the error message, for example "spawn_sdf_model".
            function: Function that is called in the loop's thread.
            timeout_s: Timeout of the start of the work [s of real time].

        Raises:
            LoopTimeoutError: The loop did not start the work in time, and will not start it later.
            Exception: Any exception of the work.
        """
        request = _Request(function)
        self._requests.put(request)
        self._arrived.set()
        if not request.done.wait(timeout_s):
            with request.lock:
                request.abandoned = not request.started
            if request.abandoned:
                raise LoopTimeoutError(f"the simulation loop did not start '{name}' within {timeout_s:g} s")
            # Started work is completed, because a partial spawn cannot be undone.
            request.done.wait(timeout_s)
        if request.error is not None:
            raise request.error
        if not request.done.is_set():
            raise LoopTimeoutError(f"the simulation loop did not complete '{name}' within {2 * timeout_s:g} s")
        return request.result  # type: ignore[no-any-return]

    def post(self, function: Callable[[], Any]) -> None:
        """Runs work in the loop's thread without waiting; the work must not raise an exception."""
        self._requests.put(_Request(function))
        self._arrived.set()

    def run_pending(self) -> None:
        """Executes all requests that have arrived; called by the loop's thread between steps."""
        if not self._arrived.is_set():
            return
        self._arrived.clear()
        while True:
            try:
                request = self._requests.get_nowait()
            except queue.Empty:
                return
            request.run()

    def serve(self, duration_s: float) -> None:
        """Executes requests for a duration [s]; called by the loop's thread instead of sleeping."""
        end_s = time.monotonic() + duration_s
        while (remaining_s := end_s - time.monotonic()) > 0:
            self._arrived.wait(remaining_s)
            self.run_pending()

    def wait(self, timeout_s: float) -> None:
        """Waits until a request arrives, or until the timeout [s]."""
        self._arrived.wait(timeout_s)
