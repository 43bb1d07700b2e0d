# SPDX-License-Identifier: BSD-3-Clause
"""The pytest fixture of emulated servo lines; import it in a `conftest.py`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from modular_framework_testing.emulators.dynamixel_finger import Finger
from modular_framework_testing.emulators.dynamixel_line import DynamixelLine
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo


@pytest.fixture
def make_line(tmp_path: Path) -> Iterator[Callable[..., DynamixelLine]]:
    """Returns a function that connects a line of emulated servos: `make_line(servo_id, ..., opening=400.0)`."""
    lines: list[DynamixelLine] = []

    def make(*servo_ids: int, opening: float = 400.0) -> DynamixelLine:
        fingers = [Finger(DynamixelServo(servo_id), opening=opening) for servo_id in servo_ids or (1,)]
        line = DynamixelLine(fingers, tmp_path / f"gripper{len(lines)}")
        line.connect()
        lines.append(line)
        return line

    yield make
    for line in lines:
        line.close()
