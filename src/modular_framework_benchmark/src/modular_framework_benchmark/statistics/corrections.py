# SPDX-License-Identifier: BSD-3-Clause
"""Corrects p values for many comparisons.

The comparisons of an experiment are two families: those of success, and those of all other metrics together. Each has
half of the error rate, so that an experiment with identical methods claims any difference with at most the whole of it,
and many other metrics do not weaken what is said of success. A family in which too few pairs are decided to show
anything leaves its half to the other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def corrected(
    p_values: Sequence[float], smallest: Sequence[float], error_rate: float, share: float
) -> tuple[list[float], int]:
    """Returns p values after Holm's correction with Tarone's count, to be compared with the whole error rate.

    A comparison that could not be shown with the pairs that are decided does not count. Sources: S. Holm, Scandinavian
    J. Statistics 6 (1979) 65-70; R. E. Tarone, Biometrics 46 (1990) 515-522.

    Args:
        p_values: Of each comparison of a family.
        smallest: Smallest p value that each could have, given how many of its pairs are decided.
        error_rate: Error rate of the experiment.
        share: Share of it that the family has.

    Returns:
        The p values, and the number of comparisons that the smallest one counts for.
    """
    order = sorted(range(len(p_values)), key=lambda place: p_values[place])
    left = np.asarray(smallest, dtype=float)[order]
    adjusted, worst, first = [1.0] * len(p_values), 0.0, 1
    for step, place in enumerate(order):
        count = _tarone_count(left[step:], error_rate * share)
        first = count if step == 0 else first
        worst = min(max(worst, p_values[place] * count / share), 1.0)
        adjusted[place] = worst
    return adjusted, first


def _tarone_count(smallest: np.ndarray, level: float) -> int:
    """Returns the smallest number k so that at most k comparisons can have a p value of level / k."""
    counts = np.arange(1, len(smallest) + 1)
    possible = np.searchsorted(np.sort(smallest), level / counts, side="right")
    return int(counts[possible <= counts][0])
