# SPDX-License-Identifier: BSD-3-Clause
"""The folder of the description package."""

from pathlib import Path

import pytest
import rospkg


@pytest.fixture(scope="session")
def package() -> Path:
    return Path(rospkg.RosPack().get_path("modular_framework_description"))
