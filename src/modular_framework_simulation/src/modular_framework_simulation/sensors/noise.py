# SPDX-License-Identifier: BSD-3-Clause
"""Noise of sensors, which depends only on the seed, the sensor and the simulated time.

A measurement is therefore independent of its subscribers, and a restarted run has the same noise.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

_BIAS_STREAM = 1
"""Stream of random numbers for biases; stream 0 is for measurements."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise model of an SDF <noise>, in the unit of the measured value.

    Attributes:
        mean: Mean of the additive noise.
        stddev: Standard deviation of the additive noise.
        bias_mean: Mean of the constant bias, whose sign is random.
        bias_stddev: Standard deviation of the constant bias.
        precision: Step of the quantization; 0 for no quantization.
    """

    mean: float = 0.0
    stddev: float = 0.0
    bias_mean: float = 0.0
    bias_stddev: float = 0.0
    precision: float = 0.0

    def __post_init__(self) -> None:
        for key in ("stddev", "bias_stddev", "precision"):
            value = getattr(self, key)
            if value < 0.0:
                raise ValueError(f"<noise>/<{key}>: got {value:g}; allowed: 0 or more")


NO_NOISE = Noise()


class NoiseSource:
    """Noise source of one sensor.

    Args:
        seed: Random seed of the simulation.
        sensor: Unique name of the sensor.
        channels: Noise models of the measured values.

    Attributes:
        active: Whether any channel is noisy.
        biases: Constant bias of each channel.
    """

    def __init__(self, seed: int, sensor: str, channels: tuple[Noise, ...]) -> None:
        digest = hashlib.sha256(f"{seed}\0{sensor}".encode()).digest()
        self._key = int.from_bytes(digest[:16], "big")
        self._channels = channels
        self.active = any(channel != NO_NOISE for channel in channels)
        random = self._random(0, _BIAS_STREAM)
        biases = [random.normal(each.bias_mean, each.bias_stddev) * random.choice((-1.0, 1.0)) for each in channels]
        self.biases: tuple[float, ...] = tuple(float(bias) for bias in biases)

    def _random(self, time_ns: int, stream: int = 0) -> np.random.Generator:
        """Returns a random generator for one time, with 2^64 numbers before the stream of the next nanosecond."""
        return np.random.Generator(np.random.Philox(key=self._key, counter=(stream << 192) | (time_ns << 64)))

    def add_noise(self, values: Values, time_ns: int) -> Values:
        """Returns values with noise; without noise, the same object.

        Args:
            values: Measured values with one row per channel, shape (channels,) or (channels, n).
            time_ns: Simulated time of the measurement [ns].
        """
        if not self.active:
            return values
        random = self._random(time_ns)
        return np.stack(
            [
                self._with_noise(row, noise, bias, random)
                for row, noise, bias in zip(values, self._channels, self.biases, strict=True)
            ]
        )

    @staticmethod
    def _with_noise(values: Values, noise: Noise, bias: float, random: np.random.Generator) -> Values:
        noisy = values + bias + random.normal(noise.mean, noise.stddev, np.shape(values))
        return np.round(noisy / noise.precision) * noise.precision if noise.precision else noisy
