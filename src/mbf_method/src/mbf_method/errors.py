# SPDX-License-Identifier: BSD-3-Clause
"""Faults of a method in another process, one class per kind of fault."""

from __future__ import annotations

from enum import IntEnum


class MethodFault(IntEnum):
    """Kind of fault; the value is a figure of the record."""

    NOT_STARTED = 1
    DIED = 2
    LATE = 3
    RAISED = 4
    INVALID_RESULT = 5
    TOO_LARGE = 6


class MethodError(RuntimeError):
    """A method in another process did not return a valid result; the message states the cause.

    Attributes:
        fault: Kind of fault.
    """

    fault: MethodFault


class MethodStartError(MethodError):
    """The method did not start, or was not ready within its time limit."""

    fault = MethodFault.NOT_STARTED


class MethodVersionError(MethodError):
    """The kind of the method or its protocol version differs from the required value."""

    fault = MethodFault.NOT_STARTED


class MethodDiedError(MethodError):
    """The method closed its connection before it returned a result."""

    fault = MethodFault.DIED


class MethodLateError(MethodError):
    """The method returned no result within its time limit."""

    fault = MethodFault.LATE


class MethodRaisedError(MethodError):
    """The method's function raised an exception."""

    fault = MethodFault.RAISED


class InvalidOutputError(MethodError):
    """A field name, shape, value or frame of the result is invalid."""

    fault = MethodFault.INVALID_RESULT


class TooLargeError(MethodError):
    """A request or a result exceeds the size limit of its receiver."""

    fault = MethodFault.TOO_LARGE


class CallCancelledError(RuntimeError):
    """The caller cancelled the call."""
