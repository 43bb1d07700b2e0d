# SPDX-License-Identifier: BSD-3-Clause
"""Errors of the commands of this package."""

from __future__ import annotations


class SetupError(Exception):
    """Base class; the message contains the found value, the allowed values and the remedy."""


class NoConfigPackageError(SetupError):
    """The given name is neither a folder nor a ROS package."""


class CreationError(SetupError):
    """The packages or the collision matrix of a robot cannot be created."""
