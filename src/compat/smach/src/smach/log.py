# SPDX-License-Identifier: BSD-3-Clause
"""Logging functions, which use Python's logging until ``set_loggers`` installs others, such as those of rospy.

``smach.loginfo``, ``logwarn``, ``logdebug`` and ``logerr`` are attributes of the package. Its modules log through
``log.info`` etc., which look these attributes up at each call, so a replacement takes effect everywhere immediately.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable

__all__ = ["logdebug", "logerr", "loginfo", "logwarn", "set_loggers"]

LogFunction = Callable[[str], object]
_LOGGER = logging.getLogger("smach")


def loginfo(msg: str) -> None:
    """Logs the progress of a machine: running states and outcomes."""
    _LOGGER.info(msg)


def logwarn(msg: str) -> None:
    """Logs a recoverable problem."""
    _LOGGER.warning(msg)


def logdebug(msg: str) -> None:
    """Logs details for developers of state machines."""
    _LOGGER.debug(msg)


def logerr(msg: str) -> None:
    """Logs a fatal problem of a state machine."""
    _LOGGER.error(msg)


def set_loggers(info: LogFunction, warn: LogFunction, debug: LogFunction, error: LogFunction) -> None:
    """Replaces the four logging functions of the package.

    Args:
        info: Replacement of ``smach.loginfo``.
        warn: Replacement of ``smach.logwarn``.
        debug: Replacement of ``smach.logdebug``.
        error: Replacement of ``smach.logerr``.
    """
    for name, function in (("loginfo", info), ("logwarn", warn), ("logdebug", debug), ("logerr", error)):
        setattr(sys.modules[__package__], name, function)


def info(msg: str) -> None:
    """Logs with the function installed as ``smach.loginfo``."""
    sys.modules[__package__].loginfo(msg)


def warn(msg: str) -> None:
    """Logs with the function installed as ``smach.logwarn``."""
    sys.modules[__package__].logwarn(msg)


def debug(msg: str) -> None:
    """Logs with the function installed as ``smach.logdebug``."""
    sys.modules[__package__].logdebug(msg)


def error(msg: str) -> None:
    """Logs with the function installed as ``smach.logerr``."""
    sys.modules[__package__].logerr(msg)
