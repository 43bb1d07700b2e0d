# SPDX-License-Identifier: BSD-3-Clause
"""One seed for all random numbers of a launch: the parameter ``/seed``, from which components derive their seeds."""

from __future__ import annotations

import hashlib
from typing import Any

import rospy
from rospy.impl.paramserver import get_param_server_cache

from modular_framework_ros.parameter_declarations import existing_declaration

SEED_PARAMETER = "/seed"
MAX_SEED = 2**31 - 1


class SeedError(ValueError):
    """The parameter ``/seed`` is not a valid seed."""


def seed_parameter() -> int | None:
    """Returns the parameter ``/seed``, at least 0; None if unset, so that runs need not be reproducible.

    Raises:
        SeedError: The value is not an integer in the allowed range.
    """
    value = _newest_value()
    if value is None or value in ("", {}):  # rospy's cache has {} for a parameter that is not set
        return None
    fault = existing_declaration("modular_framework_ros", "launch").parameters[SEED_PARAMETER].fault(value)
    if fault:
        raise SeedError(f"parameter '{SEED_PARAMETER}' {fault}")
    return int(value)


def _newest_value() -> Any:
    """Returns the cached value; rospy.get_param_cached calls the master each time while the parameter is not set."""
    cache = get_param_server_cache()
    with cache.lock:
        cached, name = cache.d or {}, SEED_PARAMETER.strip("/")
        if name in cached:
            return cached[name]
    return rospy.get_param_cached(SEED_PARAMETER, None)


def derived_seed(seed: int, *purpose: object) -> int:
    """Returns the seed for one purpose; the seeds of different purposes are independent.

    Args:
        seed: Seed of the launch.
        purpose: Identifiers of the purpose, such as a component, a request and a call counter.

    Returns:
        A seed from 0 to MAX_SEED.
    """
    text = "\0".join(str(part) for part in (seed, *purpose))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") % (MAX_SEED + 1)
