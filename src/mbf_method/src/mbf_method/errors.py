# SPDX-License-Identifier: BSD-3-Clause
"""Faults of a method in another process, one class per kind of fault."""

from __future__ import annotations


class MethodError(RuntimeError):
    """A method in another process did not return a valid result; the message states the cause."""


class MethodStartError(MethodError):
    """The method did not start, or was not ready within its time limit."""


class MethodVersionError(MethodError):
    """The kind of the method or its protocol version differs from the required value."""


class MethodDiedError(MethodError):
    """The method closed its connection before it returned a result."""


class MethodLateError(MethodError):
    """The method returned no result within its time limit."""


class MethodRaisedError(MethodError):
    """The method's function raised an exception."""


class InvalidOutputError(MethodError):
    """A field name, shape, value or frame of the result is invalid."""


class TooLargeError(MethodError):
    """A request or a result exceeds the size limit of its receiver."""
