# SPDX-License-Identifier: BSD-3-Clause
"""The hardware of docs/examples, which users copy: it passes its own tests and is found under its name."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from modular_framework_control.hardware_interface.plugins import ROBOT_HW_BASE, PluginIndex
from modular_framework_control.hardware_interface.robot_hw import RobotHW

PACKAGE = Path(__file__).resolve().parents[3] / "docs" / "examples" / "my_arm"


def test_it_passes_its_own_tests() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", str(PACKAGE / "test_my_arm.py")],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_its_package_offers_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(PACKAGE / "src"))
    index = PluginIndex(ROBOT_HW_BASE, lambda: {"my_arm": PACKAGE})
    assert index.names == ["my_arm/MyArm"] and not index.faults
    assert issubclass(index.load("my_arm/MyArm", RobotHW), RobotHW)
