# SPDX-License-Identifier: BSD-3-Clause
"""Why a report was not made."""

from __future__ import annotations


class ReportError(Exception):
    """A report could not be made: what was found, what is allowed and what to do."""
