# SPDX-License-Identifier: BSD-3-Clause
"""Where log lines go: to Python's logging, until ``set_loggers`` installs other functions (those of rospy, say).

``smach.loginfo``, ``logwarn``, ``logdebug`` and ``logerr`` are attributes of the package. Its own modules log by
``log.info`` and its like, which find them at each call, so a replacement takes effect everywhere at once.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable

__all__ = ["logdebug", "logerr", "loginfo", "logwarn", "set_loggers"]

LogFunction = Callable[[str], object]
_LOGGER = logging.getLogger("smach")


def loginfo(msg: str) -> None:
    """Logs what a user wants to follow: which state runs, which outcome it gave."""
    _LOGGER.info(msg)


def logwarn(msg: str) -> None:
    """Logs what went on but should not have happened."""
    _LOGGER.warning(msg)


def logdebug(msg: str) -> None:
    """Logs what only a developer of a state machine needs."""
    _LOGGER.debug(msg)


def logerr(msg: str) -> None:
    """Logs what keeps the state machine from going on."""
    _LOGGER.error(msg)


def set_loggers(info: LogFunction, warn: LogFunction, debug: LogFunction, error: LogFunction) -> None:
    """Replaces the four logging functions of the package.

    Args:
        info: replaces ``smach.loginfo``.
        warn: replaces ``smach.logwarn``.
        debug: replaces ``smach.logdebug``.
        error: replaces ``smach.logerr``.
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
