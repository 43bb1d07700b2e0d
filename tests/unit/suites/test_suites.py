# SPDX-License-Identifier: BSD-3-Clause
"""The suites that tests/run starts leave out no module of tests/rostest."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

ROSTEST = Path(__file__).parents[2] / "rostest"
PACKAGES = sorted(folder for folder in ROSTEST.iterdir() if list(folder.glob("test_*.py")))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda folder: folder.name)
def test_every_module_is_run_by_one_test_file(package: Path) -> None:
    named = [
        module
        for suite in package.glob("*.test")
        for test in ElementTree.parse(suite).getroot().iter("test")
        for module in test.get("args", "").split()
        if module.endswith(".py")
    ]
    assert sorted(named) == sorted(path.name for path in package.glob("test_*.py"))


def test_there_are_suites() -> None:
    assert len(PACKAGES) >= 10
