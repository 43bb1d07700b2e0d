# SPDX-License-Identifier: BSD-3-Clause
"""Multiplicity correction of p values.

The comparisons of an experiment form two families: success, and all other metrics. Each family gets half of the error
rate. Identical methods are therefore claimed to differ with at most the whole error rate, and additional metrics do not
weaken the claims on success. A family with too few discordant pairs to show anything leaves its half to the other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def holm_tarone(
    p_values: Sequence[float], min_attainable: Sequence[float], error_rate: float, fraction: float
) -> tuple[list[float], int]:
    """Returns p values after Holm's correction with Tarone's count, comparable with the whole error rate.

    Tarone's count excludes comparisons that cannot be significant with their number of discordant pairs. Sources:
    S. Holm, Scandinavian J. Statistics 6 (1979) 65-70; R. E. Tarone, Biometrics 46 (1990) 515-522.

    Args:
        p_values: P values of the comparisons of a family, shape (n,).
        min_attainable: Minimum attainable p value of each comparison, given its discordant pairs, shape (n,).
        error_rate: Error rate of the experiment.
        fraction: Fraction of the error rate that the family gets.

    Returns:
        The corrected p values, and the factor of the smallest p value.
    """
    order = sorted(range(len(p_values)), key=lambda index: p_values[index])
    ordered_minima = np.asarray(min_attainable, dtype=float)[order]
    adjusted, largest, first_factor = [1.0] * len(p_values), 0.0, 1
    for rank, index in enumerate(order):
        factor = _tarone_count(ordered_minima[rank:], error_rate * fraction)
        first_factor = factor if rank == 0 else first_factor
        largest = min(max(largest, p_values[index] * factor / fraction), 1.0)
        adjusted[index] = largest
    return adjusted, first_factor


def _tarone_count(min_attainable: np.ndarray, level: float) -> int:
    """Returns the smallest k for which at most k comparisons can attain a p value of level / k."""
    counts = np.arange(1, len(min_attainable) + 1)
    attainable = np.searchsorted(np.sort(min_attainable), level / counts, side="right")
    return int(counts[attainable <= counts][0])
