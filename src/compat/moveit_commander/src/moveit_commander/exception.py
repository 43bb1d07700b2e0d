# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of the commander."""

from __future__ import annotations


class MoveItCommanderException(Exception):  # noqa: N818 - the public name
    """A command could not be executed; the message gives the place, the value and the remedy."""


class RobotModelError(MoveItCommanderException, RuntimeError):
    """The robot's description is missing or invalid; also a RuntimeError, which MoveIt scripts catch."""


class ServerError(MoveItCommanderException, RuntimeError):
    """A topic, service or action of move_group did not answer; also a RuntimeError, which MoveIt scripts catch."""
