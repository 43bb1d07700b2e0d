# SPDX-License-Identifier: BSD-3-Clause
"""Shows the output of all launches with a failed test; import the hook in a `conftest.py`."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from modular_framework_testing.ros_session import RosSession

SHOWN_LINES = 150
"""Number of lines of each session."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Adds the last lines of the launches of all sessions to the report of a failed test."""
    report = yield
    if report.failed:
        for number, session in enumerate(RosSession.started):
            lines = session.printed_output().splitlines()[-SHOWN_LINES:]
            report.sections.append((f"Output of the launches of session {number}", "\n".join(lines)))
    return report
