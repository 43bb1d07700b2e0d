# SPDX-License-Identifier: BSD-3-Clause
"""A load beside what a benchmark measures."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator

_LOOP = "import os\nparent = os.getppid()\nwhile os.getppid() == parent:\n    sum(range(200000))"


@contextlib.contextmanager
def busy(count: int) -> Iterator[None]:
    """Keeps processors busy with `count` processes, which end with the context or with this process."""
    loops = [subprocess.Popen([sys.executable, "-c", _LOOP]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
