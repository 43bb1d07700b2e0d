# SPDX-License-Identifier: BSD-3-Clause
"""Passes a state's stop request to the waits in its thread, at any depth of the call stack."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_THREAD = threading.local()


@contextmanager
def stoppable(requested: Callable[[], bool]) -> Iterator[None]:
    """Context in which a stop request ends the waits of this thread.

    Args:
        requested: Function polled several times a second that returns whether to stop.
    """
    outer = getattr(_THREAD, "requested", None)
    _THREAD.requested = requested
    try:
        yield
    finally:
        _THREAD.requested = outer


def stop_requested() -> bool:
    """Returns whether a stop of this thread was requested; always False outside `stoppable`."""
    requested: Callable[[], bool] | None = getattr(_THREAD, "requested", None)
    return requested is not None and requested()
