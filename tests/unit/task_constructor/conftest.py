# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures of the task constructor's tests."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import smach

sys.path.insert(0, str(Path(__file__).parent))
from task_folders import World  # noqa: E402


@pytest.fixture()
def world(tmp_path: Path) -> World:
    """States and templates in a folder of the test's own."""
    return World(tmp_path)


@pytest.fixture(autouse=True)
def _no_shutdown() -> Iterator[None]:
    yield
    smach.set_shutdown_check(lambda: False)
