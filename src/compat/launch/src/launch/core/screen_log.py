# SPDX-License-Identifier: BSD-3-Clause
"""Log messages of the launch on the screen."""

from __future__ import annotations

import logging
import sys

ROOT = "launch"


class _Screen(logging.Handler):
    """Writes to the current `sys.stdout`, which roslaunch and tests replace."""

    def emit(self, record: logging.LogRecord) -> None:
        print(self.format(record), file=sys.stdout, flush=True)


def get_logger(name: str | None = None) -> logging.Logger:
    """Returns the logger of the launch, or a child logger."""
    root = logging.getLogger(ROOT)
    if not root.handlers:
        handler = _Screen()
        handler.setFormatter(logging.Formatter("[%(levelname)s] [%(name)s]: %(message)s"))
        root.addHandler(handler)
        root.setLevel(logging.INFO)
        root.propagate = False
    if not name or name == ROOT or name.startswith(f"{ROOT}."):
        return logging.getLogger(name or ROOT)
    return logging.getLogger(f"{ROOT}.{name}")
