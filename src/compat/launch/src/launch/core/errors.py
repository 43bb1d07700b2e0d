# SPDX-License-Identifier: BSD-3-Clause
"""Errors of launch descriptions, with location, invalid value, allowed values and a probable correction."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import NoReturn

PACKAGES_OF_LAUNCH = ("launch", "launch_ros", "importlib")
"""Packages whose stack frames are skipped in the search for the line of a launch file."""


class LaunchError(RuntimeError):
    """A launch description cannot be executed.

    Args:
        message: Invalid value, allowed values and the action to take.

    Attributes:
        where: File and line of the action; empty if unknown.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.where = ""

    def __str__(self) -> str:
        message = Exception.__str__(self)  # KeyError's version would add quotes
        return f"{self.where}: {message}" if self.where else message


class SubstitutionFailure(LaunchError):
    """A substitution has no value."""


class InvalidConditionExpressionError(LaunchError):
    """The text of a condition is neither true nor false."""


class InvalidLaunchFileError(LaunchError):
    """A file is not a valid launch file."""


class PackageNotFoundError(LaunchError, KeyError):
    """No ROS package has the name; a KeyError for compatibility with `ament_index_python`."""

    __str__ = LaunchError.__str__


def hint(name: str, known: Iterable[str]) -> str:
    """Returns a question with the most similar known name, after a semicolon; empty without a similar name."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean '{near[0]}'" if near else ""


def listed(names: Iterable[str]) -> str:
    """Returns sorted names for a message; `none` without names."""
    return ", ".join(sorted(names)) or "none"


def require_type(value: object, kind: type, label: str, allowed: str) -> None:
    """Checks the type of an argument.

    Args:
        value: The argument.
        kind: Required type.
        label: Description of the argument for the message.
        allowed: Allowed values, and the action to take.

    Raises:
        TypeError: The argument has another type.
    """
    if not isinstance(value, kind):
        raise TypeError(f"{label} is {value!r}; allowed: {allowed}")


def line_of_launch_file() -> str:
    """Returns file and line of the innermost caller outside of this package, which is in the launch file."""
    frame = sys._getframe(1)
    while frame.f_back is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] not in PACKAGES_OF_LAUNCH:
            break
        frame = frame.f_back
    return f"{frame.f_code.co_filename}:{frame.f_lineno}"


def unsupported_names(module: str, alternatives: Mapping[str, str]) -> Callable[[str], NoReturn]:
    """Returns a module's `__getattr__` that raises LaunchError for unsupported public names of ROS 2.

    Args:
        module: Name of the module.
        alternatives: Alternatives by unsupported name.
    """

    def raise_if_unsupported(name: str) -> NoReturn:
        if name in alternatives:
            raise LaunchError(f"{line_of_launch_file()}: {module}.{name} is not supported: {alternatives[name]}")
        raise AttributeError(f"module '{module}' has no attribute '{name}'")

    return raise_if_unsupported


def located_error(step: str, error: Exception, where: str) -> LaunchError:
    """Returns an error of a launch file's own code, with the line of the code.

    Args:
        step: Description of the failed step.
        error: Exception of the code.
        where: File and line for an exception that was raised in this package.
    """
    traceback = error.__traceback__
    while traceback is not None:
        code, name = traceback.tb_frame.f_code, traceback.tb_frame.f_globals.get("__name__", "")
        if name.partition(".")[0] not in PACKAGES_OF_LAUNCH:
            where = f"{code.co_filename}:{traceback.tb_lineno}"
        traceback = traceback.tb_next
    location = LaunchError(f"{step}: {type(error).__name__}: {error}")
    location.where = where
    return location
