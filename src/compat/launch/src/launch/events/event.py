# SPDX-License-Identifier: BSD-3-Clause
"""Event: something that happened while a description runs."""

from __future__ import annotations


class Event:
    """Base of events; event handlers choose by the class."""
