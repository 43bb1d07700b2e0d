# SPDX-License-Identifier: BSD-3-Clause
"""The method does what every grasp generator does."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
pytest.register_assert_rewrite("grasp_generator_suite")
from grasp_generator_suite import *  # noqa: E402, F403
from grasp_generator_suite import Method  # noqa: E402


@pytest.fixture(scope="module")
def method() -> Method:
    return Method("antipodal_grasps", "antipodal_grasp_generator", "between two opposite sides")
