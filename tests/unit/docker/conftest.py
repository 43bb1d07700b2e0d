# SPDX-License-Identifier: BSD-3-Clause
"""A deployer with a docker command that records its calls, and a workspace for it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from deployer import CONTAINER_USER, STAND_IN, Deployer  # noqa: E402


@pytest.fixture
def docker(tmp_path: Path) -> Deployer:
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "docker").write_text(STAND_IN.read_text())
    (tmp_path / "bin" / "docker").chmod(0o755)
    return Deployer(tmp_path)


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A folder that belongs to the user as whom the container writes."""
    folder = tmp_path / "lab"
    folder.mkdir()
    if os.getuid() == 0:
        os.chown(folder, CONTAINER_USER, CONTAINER_USER)
    return folder
