# SPDX-License-Identifier: BSD-3-Clause
"""No request waits for the compiler: compile_all() covers every compiled loop that the product calls."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

PROGRAM = Path(__file__).parent / "used_signatures.py"


def test_the_product_calls_nothing_that_compile_all_has_not_compiled(robot: Any) -> None:
    ended = subprocess.run(
        [sys.executable, str(PROGRAM)],
        input=json.dumps([robot.urdf, robot.srdf]),
        text=True,
        capture_output=True,
        timeout=600.0,
    )
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout.splitlines()[-1]) == []
