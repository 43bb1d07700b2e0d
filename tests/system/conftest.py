# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of the tests that start the whole framework, each on a master of its own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from modular_framework_testing.ros_session import RosSession
from modular_framework_testing.ros_session_report import pytest_runtest_makereport  # noqa: F401


@pytest.fixture
def session() -> Iterator[RosSession]:
    """A session whose master is started by the launch, headless."""
    started = RosSession()
    started.env.pop("DISPLAY", None)
    try:
        yield started
    finally:
        started.stop()
