# SPDX-License-Identifier: BSD-3-Clause
"""Corrects p values for many comparisons.

The comparisons of an experiment are two families: those of success, and those of all other metrics together. Each has
half of the error rate, so that an experiment with identical methods claims any difference with at most the whole of it,
and many other metrics do not weaken what is said of success. Where there is one family, it has the whole.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from statsmodels.stats.multitest import multipletests


def families(metrics: Sequence[str], first_family: str) -> tuple[float, float]:
    """Returns the shares of the error rate of the first family and of the rest.

    Args:
        metrics: Metrics that are compared.
        first_family: The metric which is a family by itself.
    """
    both = first_family in metrics and any(metric != first_family for metric in metrics)
    return (0.5, 0.5) if both else (1.0, 1.0)


def corrected(p_values: Sequence[float | None], share: float = 1.0) -> list[float | None]:
    """Returns the p values of a family after Holm's correction, to be held against the whole error rate.

    Args:
        p_values: Of each comparison; None where there was nothing to compare, which does not count.
        share: Share of the error rate that the family has.
    """
    known = [value for value in p_values if value is not None]
    if not known:
        return list(p_values)
    # A single value needs no correction; multipletests collects garbage in every call, which takes its time.
    holm = multipletests(known, method="holm")[1] if len(known) > 1 else np.asarray(known)
    adjusted = iter(np.minimum(holm / share, 1.0).tolist())
    return [None if value is None else float(next(adjusted)) for value in p_values]
