# SPDX-License-Identifier: BSD-3-Clause
"""Makes the packages of these tests importable by their names."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))

from small_package import SmallPackage  # noqa: E402


@pytest.fixture
def small(tmp_path: Path) -> SmallPackage:
    """A config package without a fault, of an arm of three joints with a gripper."""
    return SmallPackage(tmp_path)
