# SPDX-License-Identifier: BSD-3-Clause
"""An X server without a monitor, for programs with windows."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def virtual_screen(*options: str) -> Iterator[str]:
    """Starts an X server, gives the name of its display, and ends the server.

    Args:
        options: Further options of Xvfb, such as `-screen 0 1400x900x24`, as separate words.
    """
    reading, writing = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(writing), "-nolisten", "tcp", *options], pass_fds=[writing])
    os.close(writing)
    try:
        with os.fdopen(reading) as answer:
            yield f":{answer.readline().strip()}"
    finally:
        server.terminate()
        server.wait(20.0)
