# SPDX-License-Identifier: BSD-3-Clause
"""Where log lines go: to Python's logging, until ``set_loggers`` puts other functions (rospy's, say) in place.

The four functions are attributes of the package and are looked up at each call (``smach.loginfo(...)``), so a
replacement takes effect everywhere at once.
"""
from __future__ import annotations

import logging
from collections.abc import Callable

import smach

__all__ = ["logdebug", "logerr", "loginfo", "logwarn", "set_loggers"]

LogFunction = Callable[[str], object]
_LOGGER = logging.getLogger("smach")


def loginfo(msg: str) -> None:
    """Log what a user wants to follow: which state runs, which outcome it gave."""
    _LOGGER.info(msg)


def logwarn(msg: str) -> None:
    """Log what went on but should not have happened."""
    _LOGGER.warning(msg)


def logdebug(msg: str) -> None:
    """Log what only a developer of a state machine looks at."""
    _LOGGER.debug(msg)


def logerr(msg: str) -> None:
    """Log what keeps the state machine from going on."""
    _LOGGER.error(msg)


def set_loggers(info: LogFunction, warn: LogFunction, debug: LogFunction, error: LogFunction) -> None:
    """Replace the four logging functions of the package.

    Args:
        info: takes the place of ``smach.loginfo``.
        warn: takes the place of ``smach.logwarn``.
        debug: takes the place of ``smach.logdebug``.
        error: takes the place of ``smach.logerr``.
    """
    for name, function in (("loginfo", info), ("logwarn", warn), ("logdebug", debug), ("logerr", error)):
        setattr(smach, name, function)
