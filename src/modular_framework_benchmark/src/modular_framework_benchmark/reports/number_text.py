# SPDX-License-Identifier: BSD-3-Clause
"""Formats numbers with their significant digits and units."""

from __future__ import annotations

import math
from datetime import UTC, datetime

NO_VALUE = "–"
MAX_DECIMALS = {"s": 3, "m": 4, "rad": 4, "Nm": 1, "N": 1, "%": 1}
"""Maximum meaningful decimals of a unit: 1 ms, 0.1 mm, 0.0001 rad."""


def decimals_for(width: float) -> int:
    """Returns the number of decimals for a number with uncertainty `width`.

    The uncertainty keeps two digits if it begins with 1, 2 or 3, else one digit. Source: Particle Data Group, Review
    of Particle Physics, section 5.3 (with the threshold 3.54).
    """
    if not math.isfinite(width) or width <= 0.0:
        return 3
    magnitude = math.floor(math.log10(width))
    figures = 2 if width / 10.0**magnitude < 3.55 else 1
    return min(max(figures - 1 - magnitude, 0), 9)


def number_text(value: float | None, decimals: int | None = None, unit: str = "") -> str:
    """Returns a number as text; a dash for None and NaN.

    Args:
        value: Number; infinity stands for a failure.
        decimals: Number of decimals; None for three significant digits.
        unit: Unit that limits the decimals, except that small values keep two digits.
    """
    if value is None or math.isnan(value):
        return NO_VALUE
    if math.isinf(value):
        return "failure"
    magnitude = math.floor(math.log10(abs(value))) if value else 0
    if decimals is None:
        if value == 0.0:
            return "0"
        decimals = min(max(2 - magnitude, 0), 9)
    if unit in MAX_DECIMALS:
        decimals = min(decimals, max(MAX_DECIMALS[unit], 1 - magnitude))
    text = f"{value:,.{decimals}f}"
    return text.lstrip("-") if float(text.replace(",", "")) == 0.0 else text.replace("-", "−")


def percentage_text(fraction: float | None, decimals: int = 1) -> str:
    """Returns a fraction from 0 to 1 as a percentage; a dash for None and NaN."""
    if fraction is None or not math.isfinite(fraction):
        return NO_VALUE
    return f"{number_text(100.0 * fraction, decimals)} %"


def interval_text(estimate: float | None, low: float | None, high: float | None, unit: str = "") -> str:
    """Returns an estimate with its interval, with decimals that fit the interval's width and the unit.

    Args:
        estimate: Number; None and NaN give a dash.
        low: Lower end; None for no interval.
        high: Upper end; None for no interval.
        unit: Unit of the numbers.
    """
    if estimate is None or math.isnan(estimate) or low is None or high is None or (low == high and math.isinf(low)):
        return number_text(estimate, unit=unit)
    finite = [end for end in (low, estimate, high) if math.isfinite(end)]
    decimals = decimals_for((max(finite) - min(finite)) / 2.0) if finite and max(finite) > min(finite) else None
    ends = f"{number_text(low, decimals, unit)} to {number_text(high, decimals, unit)}"
    return f"{number_text(estimate, decimals, unit)} ({ends})"


def p_value_text(p_value: float | None) -> str:
    """Returns a p value as text, with digits relevant to a decision."""
    if p_value is None or not math.isfinite(p_value):
        return NO_VALUE
    if p_value < 0.001:
        return "< 0.001"
    return f"{p_value:.3f}" if p_value < 0.1 else f"{p_value:.2f}"


def count_text(count: int) -> str:
    """Returns a count with thousands separators."""
    return f"{count:,}"


def count_phrase(count: int, noun: str) -> str:
    """Returns a count with its noun: `1 episode`, `2 episodes`."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def duration_text(seconds: float | None) -> str:
    """Returns a duration with its one or two largest units."""
    if seconds is None or not math.isfinite(seconds):
        return NO_VALUE
    if seconds < 60.0:
        return f"{number_text(seconds)} s"
    minutes = int(round(seconds / 60.0))
    if minutes < 60:
        return f"{minutes} min"
    hours, minutes = divmod(minutes, 60)
    if hours < 48:
        return f"{hours} h {minutes} min"
    return f"{hours // 24} d {hours % 24} h"


def moment_text(seconds: float | None) -> str:
    """Returns a time [s since 1970] as text in UTC."""
    if seconds is None or not math.isfinite(seconds):
        return NO_VALUE
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M UTC")
