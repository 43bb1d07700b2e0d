# SPDX-License-Identifier: BSD-3-Clause
"""Base class of events during a launch."""

from __future__ import annotations


class Event:
    """Base class of events; event handlers select events by class."""
