# SPDX-License-Identifier: BSD-3-Clause
"""A number in a report has as many digits as its interval or its unit gives a meaning to."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from modular_framework_benchmark.reports.number_text import (
    MAX_DECIMALS,
    decimals_for,
    duration_text,
    interval_text,
    number_text,
    percentage_text,
)


def plain(text: str) -> str:
    """Returns a number as Python reads it."""
    return text.replace(",", "").replace("−", "-")


@pytest.mark.parametrize(
    ("value", "error", "rounded"),
    [
        (0.827, 0.119, "0.83"),  # the examples of the Review of Particle Physics, section 5.3
        (0.827, 0.367, "0.8"),
        (0.82734, 0.00967, "0.827"),  # 950 to 999 are rounded up and keep two digits: 0.010
        (14.3, 3.54, "14.3"),
        (14.3, 3.56, "14"),
        (8271.0, 119.0, "8,271"),  # no digit before the decimal point is replaced by 0
    ],
)
def test_decimals_are_those_of_the_particle_data_group(value: float, error: float, rounded: str) -> None:
    assert number_text(value, decimals_for(error)) == rounded


@given(
    st.floats(-1e4, 1e4),
    st.floats(1e-4, 1e4),
    st.floats(0.05, 0.95),
)
def test_an_interval_is_shown_with_one_or_two_digits_of_its_half_width(
    low: float, width: float, fraction: float
) -> None:
    text = interval_text(low + fraction * width, low, low + width)
    shown = [plain(each) for each in re.findall(r"[−\d.,]+", text)]
    assert len(shown) == 3
    decimals = {len(each.partition(".")[2]) for each in shown}
    assert len(decimals) == 1  # estimate and ends have the same last place
    in_last_place = (width / 2.0) * 10.0 ** decimals.pop()
    assert in_last_place >= 3.549  # two ends of an interval are never shown as the same number
    assert in_last_place < 35.51 or "." not in shown[0]
    for each, value in zip(shown, (low + fraction * width, low, low + width), strict=True):
        assert abs(float(each) - value) <= 0.15 * width


@pytest.mark.parametrize("unit", sorted(MAX_DECIMALS))
@given(value=st.floats(1e-6, 1e5), width=st.floats(1e-9, 1e-3))
def test_a_unit_limits_the_digits_of_numbers_and_intervals(unit: str, value: float, width: float) -> None:
    assume(math.floor(math.log10(value)) == math.floor(math.log10(value + width)))
    for text in (number_text(value, unit=unit), interval_text(value, value, value + width, unit)):
        for each in re.findall(r"[\d.,]+", text):
            decimals = len(plain(each).partition(".")[2])
            two_digits = 1 - math.floor(math.log10(value))
            assert decimals <= max(MAX_DECIMALS[unit], two_digits)
            assert float(plain(each)) > 0.0  # a small value keeps two digits instead of being shown as 0


def test_digits_below_the_meaning_of_a_unit_are_not_shown() -> None:
    assert interval_text(0.26388017, 0.26387989, 0.26388045, "m") == "0.2639 (0.2639 to 0.2639)"
    assert number_text(0.26388017, unit="m") == "0.264"
    assert number_text(0.0000123456, unit="m") == "0.000012"
    assert number_text(5.97349, unit="s") == "5.97"
    assert number_text(0.00149, unit="s") == "0.0015"
    assert interval_text(95.0, 76.1832, 99.1146, "%") == "95 (76 to 99)"


def test_a_number_without_interval_and_unit_has_three_significant_digits() -> None:
    assert [number_text(value) for value in (123456.0, 12.3456, 0.00123456, -1.23456)] == [
        *("123,456", "12.3", "0.00123", "−1.23"),
    ]


def test_zero_has_no_sign_and_what_is_no_number_has_a_word() -> None:
    assert number_text(0.0) == "0" and number_text(-0.0004, 2) == "0.00"
    assert number_text(None) == number_text(math.nan) == percentage_text(None) == duration_text(math.nan) == "–"
    assert interval_text(2.0, 1.0, math.inf, "s") == "2.0 (1.0 to failure)"
    assert interval_text(2.0, None, None, "s") == "2.00"
