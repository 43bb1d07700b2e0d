# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of the commander."""

from __future__ import annotations


class MoveItCommanderException(Exception):  # noqa: N818 - the public name
    """A command that could not be given; the text says where, what was got, and what to do."""


class RobotModelError(MoveItCommanderException, RuntimeError):
    """The robot's description is missing or cannot be read; also a RuntimeError, which scripts of MoveIt catch."""


class ServerError(MoveItCommanderException, RuntimeError):
    """A topic, service or action of move_group did not answer; also a RuntimeError, which scripts of MoveIt catch."""
