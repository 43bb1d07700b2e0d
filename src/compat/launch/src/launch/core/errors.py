# SPDX-License-Identifier: BSD-3-Clause
"""Errors of launch descriptions: each says where, what was found, what was allowed and what is probably meant."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import NoReturn

PACKAGES_OF_LAUNCH = ("launch", "launch_ros", "importlib")
"""Frames of these are skipped when the line of a launch file is looked for."""


class LaunchError(RuntimeError):
    """A launch description that cannot be carried out.

    Args:
        message: What was found, what was allowed and what to do.

    Attributes:
        where: File and line of the action concerned; empty as long as nobody knows it.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.where = ""

    def __str__(self) -> str:
        message = Exception.__str__(self)  # that of KeyError puts quotes around it
        return f"{self.where}: {message}" if self.where else message


class SubstitutionFailure(LaunchError):
    """A substitution has no value."""


class InvalidConditionExpressionError(LaunchError):
    """The text of a condition is neither true nor false."""


class InvalidLaunchFileError(LaunchError):
    """A file holds no launch description."""


class PackageNotFoundError(LaunchError, KeyError):
    """No ROS package has this name. It is a KeyError too, as in `ament_index_python`."""

    __str__ = LaunchError.__str__


def hint(name: str, known: Iterable[str]) -> str:
    """Returns, after a semicolon, a question with the known name that is most like `name`; empty when none is."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean '{near[0]}'" if near else ""


def listed(names: Iterable[str]) -> str:
    """Returns names in order, for a message; `none` when there are none."""
    return ", ".join(sorted(names)) or "none"


def require_type(value: object, kind: type, what: str, allowed: str) -> None:
    """Checks the type of an argument.

    Args:
        value: The argument.
        kind: The type it must have.
        what: What it is, for the message.
        allowed: What is allowed, and what to do.

    Raises:
        TypeError: It has another type.
    """
    if not isinstance(value, kind):
        raise TypeError(f"{what} is {value!r}; allowed: {allowed}")


def line_of_launch_file() -> str:
    """Returns file and line of the innermost caller outside of this package: the launch file."""
    frame = sys._getframe(1)
    while frame.f_back is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] not in PACKAGES_OF_LAUNCH:
            break
        frame = frame.f_back
    return f"{frame.f_code.co_filename}:{frame.f_lineno}"


def refusal_of(module: str, not_offered: Mapping[str, str]) -> Callable[[str], NoReturn]:
    """Returns the `__getattr__` of a module that refuses public names of ROS 2 which it does not offer.

    Args:
        module: Its name.
        not_offered: What to do instead, by name.
    """

    def refuse(name: str) -> NoReturn:
        if name in not_offered:
            raise LaunchError(f"{line_of_launch_file()}: {module}.{name} is not offered: {not_offered[name]}")
        raise AttributeError(f"module '{module}' has no attribute '{name}'")

    return refuse


def located_error(what: str, error: Exception, where: str) -> LaunchError:
    """Returns the error of a launch file's own code, with the line of that code.

    Args:
        what: What was being done.
        error: What the code raised.
        where: File and line, when the error itself comes from this package.
    """
    traceback = error.__traceback__
    while traceback is not None:
        code, name = traceback.tb_frame.f_code, traceback.tb_frame.f_globals.get("__name__", "")
        if name.partition(".")[0] not in PACKAGES_OF_LAUNCH:
            where = f"{code.co_filename}:{traceback.tb_lineno}"
        traceback = traceback.tb_next
    found = LaunchError(f"{what}: {type(error).__name__}: {error}")
    found.where = where
    return found
