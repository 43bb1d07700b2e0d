# SPDX-License-Identifier: BSD-3-Clause
"""Passes log records of the control loop to another thread, so that the loop never waits for a file or /rosout."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable

from modular_framework_control.ros.outbox import Outbox

ROSOUT = "rosout"
"""rospy's logger; `rospy.logwarn` and its like write to it, the loggers of control loop and hardware are below it."""


class LoopLog(logging.Handler):
    """Replaces the handlers of rospy's logger; a thread of its own passes the records to them."""

    def __init__(self) -> None:
        super().__init__()
        self._outbox = Outbox()
        self._logger = logging.getLogger(ROSOUT)
        self._served: list[logging.Handler] | None = None
        self._propagates = True
        self._complaining: int | None = None

    def createLock(self) -> None:  # noqa: N802  # the name is logging's
        """Makes no lock, so that the loop never waits for one."""
        self.lock = None

    def begin(self) -> None:
        """Takes the records from now on, unless another LoopLog does."""
        if any(isinstance(handler, LoopLog) for handler in self._logger.handlers):
            return
        self._outbox.start()
        self._served, self._propagates = self._logger.handlers, self._logger.propagate
        self._logger.handlers, self._logger.propagate = [self], False

    def emit(self, record: logging.LogRecord) -> None:
        """Passes the record on with the text it has now."""
        if threading.get_ident() == self._complaining:
            return
        try:
            record.msg, record.args = record.getMessage(), None
        except Exception:  # a wrong format must not end the loop
            self._complain(self, record)
            return
        self._outbox.put(self._write, record)

    def _write(self, record: logging.LogRecord) -> None:
        for handler in self._served or ():
            if record.levelno >= handler.level:
                self._hand(handler.handle, handler, record)
        if self._propagates:
            self._hand(logging.getLogger().callHandlers, self, record)

    def _hand(
        self, take: Callable[[logging.LogRecord], object], handler: logging.Handler, record: logging.LogRecord
    ) -> None:
        """Passes the record to `handler`. An error of the handler is not logged, which would call the handler again."""
        try:
            take(record)
        except Exception:
            self._complain(handler, record)

    def _complain(self, handler: logging.Handler, record: logging.LogRecord) -> None:
        """Prints an error of a handler to the standard error, as logging does."""
        self._complaining = threading.get_ident()
        with contextlib.suppress(Exception):
            handler.handleError(record)
        self._complaining = None

    def flush(self) -> None:
        """Waits until the records taken so far are written."""
        self._outbox.flush()

    def end(self) -> None:
        """Writes all records that wait, then restores the former handlers; may be called twice."""
        if self._served is None:
            return
        added = [handler for handler in self._logger.handlers if handler is not self]
        self._logger.handlers, self._logger.propagate = self._served + added, self._propagates
        self._outbox.close()
        self._served = None
