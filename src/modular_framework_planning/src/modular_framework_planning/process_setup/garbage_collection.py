# SPDX-License-Identifier: BSD-3-Clause
"""Exempts the objects that a process loads once from Python's garbage collection."""

from __future__ import annotations

import atexit
import gc


def freeze_loaded_objects() -> None:
    """Exempts all existing objects from garbage collection; call this function when a process is ready to plan.

    Modules, compiled loops and the robot are several hundred thousand objects. Visiting these objects during every few
    plans took a tenth of the planning time. At exit, the objects are collected as usual, because bindings report
    remaining objects as leaks.
    """
    gc.collect()
    gc.freeze()
    atexit.register(gc.unfreeze)
