# SPDX-License-Identifier: BSD-3-Clause
"""Errors of this library, one class per kind of mistake in a state machine."""

from __future__ import annotations

__all__ = [
    "InvalidConstructionError",
    "InvalidStateError",
    "InvalidTransitionError",
    "InvalidUserCodeError",
    "SmachError",
]


class SmachError(Exception):
    """Base class of all errors of this library."""


class InvalidTransitionError(SmachError):
    """A transition has an unknown source or target, or an outcome has no transition."""


class InvalidStateError(SmachError):
    """A state cannot be added to a container."""


class InvalidConstructionError(SmachError):
    """A container is used in the wrong state: open instead of closed, or closed instead of open."""


class InvalidUserCodeError(SmachError):
    """User code raised an error or violated its userdata declaration."""
