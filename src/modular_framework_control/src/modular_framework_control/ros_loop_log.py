# SPDX-License-Identifier: BSD-3-Clause
"""Carries what the control loop says to the log, so that the loop never waits for a file, a terminal or /rosout."""
from __future__ import annotations

import logging

from modular_framework_control.ros_outbox import Outbox

ROSOUT = "rosout"
"""rospy's logger; `rospy.logwarn` and its like write to it, the loggers of control loop and hardware are below it."""


class LoopLog(logging.Handler):
    """Takes the place of the handlers of rospy's logger; a thread of its own hands the records to them."""

    def __init__(self) -> None:
        super().__init__()
        self._outbox = Outbox()
        self._logger = logging.getLogger(ROSOUT)
        self._served: list[logging.Handler] | None = None
        self._propagates = True

    def createLock(self) -> None:  # noqa: N802  # the name is logging's
        """None is needed, and the loop need not wait for one."""
        self.lock = None

    def begin(self) -> None:
        """Take the records from now on, unless another one does."""
        if any(isinstance(handler, LoopLog) for handler in self._logger.handlers):
            return
        self._outbox.start()
        self._served, self._propagates = self._logger.handlers, self._logger.propagate
        self._logger.handlers, self._logger.propagate = [self], False

    def emit(self, record: logging.LogRecord) -> None:
        """Hand on the record with the text it has now."""
        record.msg, record.args = record.getMessage(), None
        self._outbox.put(self._write, record)

    def _write(self, record: logging.LogRecord) -> None:
        for handler in self._served or ():
            if record.levelno >= handler.level:
                handler.handle(record)
        if self._propagates:
            logging.getLogger().callHandlers(record)

    def end(self) -> None:
        """Leave the records to those that had them before, after they got all; may be called twice."""
        if self._served is None:
            return
        added = [handler for handler in self._logger.handlers if handler is not self]
        self._logger.handlers, self._logger.propagate = self._served + added, self._propagates
        self._outbox.close()
        self._served = None
