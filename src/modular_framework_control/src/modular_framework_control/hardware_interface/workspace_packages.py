# SPDX-License-Identifier: BSD-3-Clause
"""Finds the packages of the sourced workspace."""

from __future__ import annotations

from pathlib import Path

import rospkg


def packages_of_workspace() -> dict[str, Path]:
    """Folder of each package, by name."""
    packages = rospkg.RosPack()
    return {name: Path(packages.get_path(name)) for name in packages.list()}
