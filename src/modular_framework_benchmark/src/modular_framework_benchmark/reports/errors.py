# SPDX-License-Identifier: BSD-3-Clause
"""Errors of reports."""

from __future__ import annotations


class ReportError(Exception):
    """A report could not be created; the message gives the fault, the allowed values and the remedy."""
