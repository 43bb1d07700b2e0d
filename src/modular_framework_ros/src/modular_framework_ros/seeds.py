# SPDX-License-Identifier: BSD-3-Clause
"""One seed for all random numbers of a launch: the parameter ``/seed``, from which every component derives its own."""

from __future__ import annotations

import hashlib
from typing import Any

import rospy
from rospy.impl.paramserver import get_param_server_cache

from modular_framework_ros.parameter_declarations import existing_declaration

SEED_PARAMETER = "/seed"
LARGEST_SEED = 2**31 - 1


class SeedError(ValueError):
    """The parameter ``/seed`` is no seed."""


def seed_parameter() -> int | None:
    """Returns the parameter ``/seed``, 0 or more; None where it is not set and random numbers may differ every time.

    Raises:
        SeedError: it is no whole number in range.
    """
    value = _newest_value()
    if value is None or value in ("", {}):  # {} stands for a parameter that is not set
        return None
    fault = existing_declaration("modular_framework_ros", "launch").parameters[SEED_PARAMETER].fault(value)
    if fault:
        raise SeedError(f"parameter '{SEED_PARAMETER}' {fault}")
    return int(value)


def _newest_value() -> Any:
    """Returns the value the master sent last; rospy.get_param_cached asks every time while the parameter is not set."""
    cache = get_param_server_cache()
    with cache.lock:
        known, name = cache.d or {}, SEED_PARAMETER.strip("/")
        if name in known:
            return known[name]
    return rospy.get_param_cached(SEED_PARAMETER, None)


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
