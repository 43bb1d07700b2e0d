# SPDX-License-Identifier: BSD-3-Clause
"""A progress bar for long computations."""

from __future__ import annotations

from typing import TextIO

WIDTH = 40


class ProgressBar:
    """Draws a progress bar on a terminal. On any other stream, only the finished bar is written.

    Args:
        title: Name of the computation.
        out: Output stream.
    """

    def __init__(self, title: str, out: TextIO) -> None:
        self._title, self._out = title, out
        self._shown_percent = -1

    def show(self, fraction: float) -> None:
        """Draws the completed fraction, 0 to 1."""
        percent = int(100.0 * min(max(fraction, 0.0), 1.0))
        if percent == self._shown_percent or (percent < 100 and not self._out.isatty()):
            return
        self._shown_percent = percent
        filled = WIDTH * percent // 100
        start = "\r" if self._out.isatty() else ""
        self._out.write(f"{start}{self._title} [{'#' * filled}{'.' * (WIDTH - filled)}] {percent:3d} %")
        self._out.write("\n" if percent == 100 else "")
        self._out.flush()
