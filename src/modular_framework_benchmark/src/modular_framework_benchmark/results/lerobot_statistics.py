# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of the features of a LeRobot dataset, used for normalisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
FeatureStatistics = dict[str, NDArray[np.float64]]


def feature_statistics(values: NDArray[np.generic]) -> FeatureStatistics:
    """Returns the statistics of a feature over the frames of an episode.

    Args:
        values: Values of the feature, shape (frames,) or (frames, width).

    Returns:
        `min`, `max`, `mean`, `std` and quantiles of shape (width,), and `count` of shape (1,).
    """
    rows = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        "count": np.array([len(rows)]),
        **{name: np.quantile(rows, level, axis=0) for name, level in QUANTILES.items()},
    }


def image_statistics(images: NDArray[np.uint8]) -> FeatureStatistics:
    """Returns the statistics of images per colour channel, with values scaled to [0, 1].

    Args:
        images: Sampled frames of an episode, shape (images, height, width, 3).

    Returns:
        Statistics as in `feature_statistics`, of shape (3, 1, 1); `count` is the number of images.
    """
    statistics = feature_statistics(images.reshape(-1, 3) / 255.0)
    shaped = {name: value.reshape(3, 1, 1) for name, value in statistics.items() if name != "count"}
    return {**shaped, "count": np.array([len(images)])}


def joined_statistics(parts: Sequence[FeatureStatistics]) -> FeatureStatistics:
    """Returns the statistics of the dataset from the statistics of its episodes.

    Mean and deviation are exact (Chan et al., parallel variance). Quantiles cannot be combined exactly: as in LeRobot,
    lower quantiles are the minimum and upper quantiles the maximum over the episodes.
    """
    counts = np.stack([part["count"] for part in parts]).astype(np.float64)
    means = np.stack([part["mean"] for part in parts])
    weights = counts.reshape(len(parts), *([1] * (means.ndim - 1))) / counts.sum()
    mean = (means * weights).sum(axis=0)
    variances = np.stack([part["std"] for part in parts]) ** 2 + (means - mean) ** 2
    joined = {
        "min": np.stack([part["min"] for part in parts]).min(axis=0),
        "max": np.stack([part["max"] for part in parts]).max(axis=0),
        "mean": mean,
        "std": np.sqrt((variances * weights).sum(axis=0)),
        "count": counts.sum(axis=0).astype(np.int64),
    }
    for name, level in QUANTILES.items():
        stacked = np.stack([part[name] for part in parts])
        joined[name] = stacked.min(axis=0) if level <= 0.5 else stacked.max(axis=0)
    return joined


def as_lists(statistics: Mapping[str, FeatureStatistics]) -> dict[str, dict[str, list[object]]]:
    """Returns statistics as nested lists, for JSON."""
    return {feature: {name: value.tolist() for name, value in item.items()} for feature, item in statistics.items()}
