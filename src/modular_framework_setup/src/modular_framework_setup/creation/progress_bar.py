# SPDX-License-Identifier: BSD-3-Clause
"""A bar that shows how far a long computation is."""

from __future__ import annotations

from typing import TextIO

WIDTH = 40


class ProgressBar:
    """Draws a bar on a terminal; elsewhere only its end is written.

    Args:
        title: what is computed.
        out: where to draw.
    """

    def __init__(self, title: str, out: TextIO) -> None:
        self._title, self._out = title, out
        self._shown = -1

    def show(self, share: float) -> None:
        """Draws the share that is done, from 0 to 1."""
        percent = int(100.0 * min(max(share, 0.0), 1.0))
        if percent == self._shown or (percent < 100 and not self._out.isatty()):
            return
        self._shown = percent
        full = WIDTH * percent // 100
        start = "\r" if self._out.isatty() else ""
        self._out.write(f"{start}{self._title} [{'#' * full}{'.' * (WIDTH - full)}] {percent:3d} %")
        self._out.write("\n" if percent == 100 else "")
        self._out.flush()
