# SPDX-License-Identifier: BSD-3-Clause
"""Packages of the sourced workspace."""

from __future__ import annotations

from pathlib import Path

import rospkg


def packages_of_workspace() -> dict[str, Path]:
    """Returns the folder of each package, by name."""
    packages = rospkg.RosPack()
    return {name: Path(packages.get_path(name)) for name in packages.list()}
