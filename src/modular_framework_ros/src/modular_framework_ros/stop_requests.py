# SPDX-License-Identifier: BSD-3-Clause
"""Tells calls that wait whether the state that made them has been asked to stop, however deep below it they are."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_THREAD = threading.local()


@contextmanager
def stoppable(requested: Callable[[], bool]) -> Iterator[None]:
    """Makes calls of this thread that wait heed a request to stop, as long as the context lasts.

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
    """Returns whether what this thread is doing has been asked to stop; outside of ``stoppable`` it never has."""
    requested: Callable[[], bool] | None = getattr(_THREAD, "requested", None)
    return requested is not None and requested()
