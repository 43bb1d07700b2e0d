# SPDX-License-Identifier: BSD-3-Clause
"""The control loop of the tests of controllers."""

from __future__ import annotations

import pytest

from modular_framework_testing.control.stepped_loop import SteppedLoop


@pytest.fixture
def make_loop() -> type[SteppedLoop]:
    """The class of loops."""
    return SteppedLoop
