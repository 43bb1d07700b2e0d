# SPDX-License-Identifier: BSD-3-Clause
"""Passes log records of the control loop to another thread: the loop must never wait for a file or /rosout."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable

from modular_framework_control.ros.outbox import Outbox

ROSOUT = "rosout"
"""Logger of `rospy.logwarn` and the like; parent of the loggers of the control loop and the hardware."""


class LoopLog(logging.Handler):
    """Replaces the handlers of rospy's logger; a separate thread passes the records to these handlers."""

    def __init__(self) -> None:
        super().__init__()
        self._outbox = Outbox()
        self._logger = logging.getLogger(ROSOUT)
        self._former_handlers: list[logging.Handler] | None = None
        self._formerly_propagated = True
        self._error_thread: int | None = None

    def createLock(self) -> None:  # noqa: N802  # the name is logging's
        """Creates no lock: the loop must never wait for another thread."""
        self.lock = None

    def begin(self) -> None:
        """Replaces the handlers of rospy's logger, unless another LoopLog has replaced them."""
        if any(isinstance(handler, LoopLog) for handler in self._logger.handlers):
            return
        self._outbox.start()
        self._former_handlers, self._formerly_propagated = self._logger.handlers, self._logger.propagate
        self._logger.handlers, self._logger.propagate = [self], False

    def emit(self, record: logging.LogRecord) -> None:
        """Queues the record with its text formatted now, as the arguments may change later."""
        if threading.get_ident() == self._error_thread:
            return
        try:
            record.msg, record.args = record.getMessage(), None
        except Exception:  # a wrong format string must not end the loop
            self._print_error(self, record)
            return
        self._outbox.put(self._write, record)

    def _write(self, record: logging.LogRecord) -> None:
        for handler in self._former_handlers or ():
            if record.levelno >= handler.level:
                self._pass_to(handler.handle, handler, record)
        if self._formerly_propagated:
            self._pass_to(logging.getLogger().callHandlers, self, record)

    def _pass_to(
        self, pass_record: Callable[[logging.LogRecord], object], handler: logging.Handler, record: logging.LogRecord
    ) -> None:
        """Passes the record to `handler`; never logs its errors, which would call `handler` again."""
        try:
            pass_record(record)
        except Exception:
            self._print_error(handler, record)

    def _print_error(self, handler: logging.Handler, record: logging.LogRecord) -> None:
        """Prints an error of a handler to standard error, as the logging module does."""
        self._error_thread = threading.get_ident()
        with contextlib.suppress(Exception):
            handler.handleError(record)
        self._error_thread = None

    def flush(self) -> None:
        """Waits until the records queued so far are written."""
        self._outbox.flush()

    def end(self) -> None:
        """Writes all queued records, then restores the former handlers; may be called twice."""
        if self._former_handlers is None:
            return
        added = [handler for handler in self._logger.handlers if handler is not self]
        self._logger.handlers, self._logger.propagate = self._former_handlers + added, self._formerly_propagated
        self._outbox.close()
        self._former_handlers = None
