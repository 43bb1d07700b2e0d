# SPDX-License-Identifier: BSD-3-Clause
"""Makes the state fixtures of this folder importable, and undoes what a test did to the library's hooks."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import smach

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(autouse=True)
def _no_shutdown() -> Iterator[None]:
    yield
    smach.set_shutdown_check(lambda: False)
