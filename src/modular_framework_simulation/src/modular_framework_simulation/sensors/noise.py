# SPDX-License-Identifier: BSD-3-Clause
"""Noise of sensors: what is added to a value depends on the seed, the sensor and simulated time, and on nothing else.

So a measurement does not depend on when somebody subscribed, and a run that begins again has the same noise.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

_BIASES = 1
"""The part of the random numbers that biases are drawn from; part 0 has those of measurements."""


@dataclass(frozen=True, slots=True)
class Noise:
    """A noise model, as the <noise> of SDF has it; the unit is that of what is measured.

    Attributes:
        mean: Of what is added to each value.
        stddev: Its standard deviation.
        bias_mean: Mean of a bias that stays the same; its sign is drawn.
        bias_stddev: Standard deviation of the bias.
        precision: Values are rounded to multiples of it; 0: they are not.
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
    """The noise of one sensor.

    Args:
        seed: Of the simulation.
        sensor: Name of the sensor, which no other one has.
        channels: The noise of each of the values that it measures.

    Attributes:
        active: Whether there is any noise.
        biases: What is added to the values of each channel all the time.
    """

    def __init__(self, seed: int, sensor: str, channels: tuple[Noise, ...]) -> None:
        digest = hashlib.sha256(f"{seed}\0{sensor}".encode()).digest()
        self._key = int.from_bytes(digest[:16], "big")
        self._channels = channels
        self.active = any(channel != NO_NOISE for channel in channels)
        random = self._random(0, _BIASES)
        drawn = [random.normal(each.bias_mean, each.bias_stddev) * random.choice((-1.0, 1.0)) for each in channels]
        self.biases: tuple[float, ...] = tuple(float(bias) for bias in drawn)

    def _random(self, time_ns: int, part: int = 0) -> np.random.Generator:
        """Returns random numbers of one instant; 2^64 can be drawn before they meet those of another."""
        return np.random.Generator(np.random.Philox(key=self._key, counter=(part << 192) | (time_ns << 64)))

    def added_to(self, values: Values, time_ns: int) -> Values:
        """Returns values with noise; without noise the same object.

        Args:
            values: One row a channel, (channels,) or (channels, n).
            time_ns: When they were measured [ns].
        """
        if not self.active:
            return values
        random = self._random(time_ns)
        return np.stack(
            [
                self._noisy(row, noise, bias, random)
                for row, noise, bias in zip(values, self._channels, self.biases, strict=True)
            ]
        )

    @staticmethod
    def _noisy(values: Values, noise: Noise, bias: float, random: np.random.Generator) -> Values:
        noisy = values + bias + random.normal(noise.mean, noise.stddev, np.shape(values))
        return np.round(noisy / noise.precision) * noise.precision if noise.precision else noisy
