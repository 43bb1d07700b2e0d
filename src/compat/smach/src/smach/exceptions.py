# SPDX-License-Identifier: BSD-3-Clause
"""The errors of this library: each kind of mistake in a state machine has its own class."""

from __future__ import annotations

__all__ = [
    "InvalidConstructionError",
    "InvalidStateError",
    "InvalidTransitionError",
    "InvalidUserCodeError",
    "SmachError",
]


class SmachError(Exception):
    """Base of every error this library raises."""


class InvalidTransitionError(SmachError):
    """A transition starts or ends where there is nothing, or an outcome leads nowhere."""


class InvalidStateError(SmachError):
    """A state cannot be part of the container it was given to."""


class InvalidConstructionError(SmachError):
    """A container is used as if it were open (or closed) while it is not."""


class InvalidUserCodeError(SmachError):
    """Code written by the user of the library raised, or broke the contract of its userdata."""
