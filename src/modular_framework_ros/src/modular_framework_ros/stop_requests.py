# SPDX-License-Identifier: BSD-3-Clause
"""Passes a state's request to stop to the waits in its thread, at any depth of the call stack."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_THREAD = threading.local()


@contextmanager
def stoppable(requested: Callable[[], bool]) -> Iterator[None]:
    """Makes waiting calls of this thread end on a request to stop, as long as the context lasts.

    Args:
        requested: Whether there is such a request; asked several times a second.
    """
    outer = getattr(_THREAD, "requested", None)
    _THREAD.requested = requested
    try:
        yield
    finally:
        _THREAD.requested = outer


def stop_requested() -> bool:
    """Returns whether this thread has been asked to stop; always False outside of ``stoppable``."""
    requested: Callable[[], bool] | None = getattr(_THREAD, "requested", None)
    return requested is not None and requested()
