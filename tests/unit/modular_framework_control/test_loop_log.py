# SPDX-License-Identifier: BSD-3-Clause
"""The control loop logs without waiting for the handlers that write the log."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from modular_framework_control.ros.loop_log import LoopLog

LOGGER = logging.getLogger("rosout.test_of_the_loop_log")


class StuckTerminal(logging.Handler):
    """Writes nothing until it is let."""

    def __init__(self) -> None:
        super().__init__()
        self.go_on = threading.Event()
        self.written: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        assert self.go_on.wait(10.0)
        self.written.append(self.format(record))


@pytest.fixture
def terminal() -> Iterator[StuckTerminal]:
    stuck, rosout = StuckTerminal(), logging.getLogger("rosout")
    rosout.addHandler(stuck)
    yield stuck
    stuck.go_on.set()
    rosout.removeHandler(stuck)


def test_a_log_that_cannot_be_written_keeps_nobody_waiting_and_loses_nothing(terminal: StuckTerminal) -> None:
    log = LoopLog()
    log.begin()
    fault = ["lost"]
    with ThreadPoolExecutor() as threads:
        try:
            threads.submit(LOGGER.warning, "the link is %s", fault).result(5.0)
            fault.append("and found")
            threads.submit(LOGGER.error, "again").result(5.0)
            threads.submit(logging.getLogger("rosout").error, "by rospy").result(5.0)
            threads.submit(logging.getLogger("rosout.first_used_now").error, "by a plugin").result(5.0)
        finally:
            terminal.go_on.set()
    log.end()
    assert terminal.written == ["the link is ['lost']", "again", "by rospy", "by a plugin"]


class BrokenTerminal(logging.Handler):
    """Can write nothing, and complains by `complaint`."""

    def __init__(self, complaint: Callable[[], None]) -> None:
        super().__init__()
        self.complaint = complaint
        self.asked: list[str] = []
        self.complaints = 0

    def emit(self, record: logging.LogRecord) -> None:
        self.asked.append(record.getMessage())
        raise BrokenPipeError("nobody reads")

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  # the name is logging's
        self.complaints += 1
        self.complaint()


def fail_again() -> None:
    raise ValueError("closed file")


@pytest.mark.parametrize("complaint", [fail_again, lambda: LOGGER.error("cannot write"), lambda: None])
def test_a_log_that_cannot_be_written_at_all_is_tried_once_and_the_others_get_theirs(
    terminal: StuckTerminal, complaint: Callable[[], None]
) -> None:
    terminal.go_on.set()
    rosout, broken, log = logging.getLogger("rosout"), BrokenTerminal(complaint), LoopLog()
    rosout.handlers.insert(0, broken)
    try:
        log.begin()
        LOGGER.error("one single line")
        log.flush()
        LOGGER.error("another line")
        log.flush()
        log.end()
    finally:
        rosout.removeHandler(broken)
    assert broken.asked == terminal.written == ["one single line", "another line"]
    assert broken.complaints == 2


def test_words_that_do_not_fit_together_disturb_nobody(
    terminal: StuckTerminal, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal.go_on.set()
    log = LoopLog()
    log.begin()
    LOGGER.error("%d joints", "six")
    LOGGER.error("%d joints", 6)
    log.end()
    assert terminal.written == ["6 joints"]
    assert "Logging error" in capsys.readouterr().err


def test_afterwards_the_log_is_as_before(terminal: StuckTerminal) -> None:
    terminal.go_on.set()
    first, second = LoopLog(), LoopLog()
    first.begin()
    second.begin()
    LOGGER.warning("once")
    for log in (first, second):
        log.end()
        log.end()
    assert terminal.written == ["once"]
    LOGGER.warning("at once")
    assert terminal.written == ["once", "at once"]
