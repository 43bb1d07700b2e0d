# SPDX-License-Identifier: BSD-3-Clause
"""Exports a figure as PNG or PDF through a headless browser."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_benchmark.reports.figure_style import NamedFigure

FORMATS = ("png", "pdf")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
WIDTH_PX = 900
SCALE = 2.0  # image pixels per figure pixel of a PNG


def find_browser() -> Path:
    """Returns the browser from the environment variable BROWSER_PATH, or else Chromium or Chrome.

    Raises:
        ReportError: No browser is installed.
    """
    named = os.environ.get("BROWSER_PATH")
    browser = shutil.which(named) if named else next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        searched = f"BROWSER_PATH is {named}" if named else f"searched PATH for {', '.join(BROWSERS)}"
        raise ReportError(
            f"figure: found no browser to draw it ({searched}); install Debian's package chromium "
            "(apt-get install chromium), or name one in BROWSER_PATH. The HTML report needs none"
        )
    return Path(browser)


def find_figure(figures: Sequence[NamedFigure], name: str) -> NamedFigure:
    """Returns a figure by its name.

    Raises:
        ReportError: The report has no figure of this name.
    """
    for figure in figures:
        if figure.name == name:
            return figure
    raise ReportError(f"--figure: got '{name}'; this report has: {', '.join(figure.name for figure in figures)}")


def figure_image(figure: NamedFigure, image_format: str) -> bytes:
    """Returns a figure as an image file.

    Args:
        figure: Figure to draw.
        image_format: Format, one of FORMATS.

    Raises:
        ReportError: No browser is installed, or the browser fails.
    """
    browser = find_browser()
    import kaleido  # slow to import, and most reports need no image

    height = figure.figure.layout.height
    options = {"format": image_format, "width": WIDTH_PX, "height": height}
    if image_format == "png":
        options["scale"] = SCALE
    try:
        return kaleido.calc_fig_sync(
            figure.figure.to_dict(),
            opts=options,
            kopts={"path": str(browser), "page_generator": kaleido.PageGenerator(mathjax=False), "timeout": 120},
        )
    except Exception as error:  # kaleido and the browser raise many kinds of errors
        raise ReportError(
            f"figure {figure.name}: {browser} did not draw it: {type(error).__name__}: {error}; "
            "try another browser in BROWSER_PATH"
        ) from error
