# SPDX-License-Identifier: BSD-3-Clause
"""Keeps Python's garbage collector away from what a process has loaded for good."""

from __future__ import annotations

import atexit
import gc


def freeze_loaded_objects() -> None:
    """Has the collector leave out all objects there are now; to be called when a process is ready to plan.

    Modules, compiled loops and the robot are several hundred thousand objects. Looking through them in the middle of
    every few plans took a tenth of the time of planning. At exit they are collected as usual: bindings report objects
    that are left then.
    """
    gc.collect()
    gc.freeze()
    atexit.register(gc.unfreeze)
