# SPDX-License-Identifier: BSD-3-Clause
"""One seed for all random numbers of a launch: the parameter ``/seed``, from which every component derives its own."""

from __future__ import annotations

import hashlib

import rospy

SEED_PARAMETER = "/seed"
LARGEST_SEED = 2**31 - 1


class SeedError(ValueError):
    """The parameter ``/seed`` is no seed."""


def seed_parameter() -> int | None:
    """Returns the parameter ``/seed``, 0 or more; None where it is not set and random numbers may differ every time.

    Raises:
        SeedError: it is no whole number in range.
    """
    value = rospy.get_param_cached(SEED_PARAMETER, None)
    if value is None or value in ("", {}):  # {} stands for a parameter that was deleted
        return None
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_SEED:
        raise SeedError(
            f"parameter {SEED_PARAMETER} is {value!r}; allowed is a whole number from 0 to {LARGEST_SEED}, or none for "
            "random numbers that differ every time"
        )
    return value


def derived_seed(seed: int, *purpose: object) -> int:
    """Returns the seed of one purpose, from which that of another one cannot be guessed.

    Args:
        seed: of the launch.
        purpose: what the random numbers are for, such as a component, a request, and how often that was asked before.

    Returns:
        A number from 0 to LARGEST_SEED.
    """
    text = "\0".join(str(part) for part in (seed, *purpose))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") % (LARGEST_SEED + 1)
