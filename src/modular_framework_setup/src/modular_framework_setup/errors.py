# SPDX-License-Identifier: BSD-3-Clause
"""Why a command of this package cannot do what was asked."""

from __future__ import annotations


class SetupError(Exception):
    """Base; the text says what was found, what is allowed and what to do."""


class NoConfigPackageError(SetupError):
    """What was named is no folder and no ROS package."""


class CreationError(SetupError):
    """The packages of a robot, or its collision matrix, cannot be made."""
