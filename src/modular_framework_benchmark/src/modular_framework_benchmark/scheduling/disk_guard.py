# SPDX-License-Identifier: BSD-3-Clause
"""Ends a run cleanly before the disk is full or the records exceed their limit."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

MIN_FREE_BYTES = 500e6
"""Space to keep free on the disk for the database, the report and other users [B]."""
GB = 1e9


class DiskGuard:
    """Monitors the disk space of episodes.

    Args:
        folder: Parent folder of the episodes' folders, which may be missing.
        limit_bytes: Maximum size of all episodes [B].
        min_free_bytes: Space to keep free on the disk [B].
    """

    def __init__(self, folder: Path, limit_bytes: float = math.inf, min_free_bytes: float = MIN_FREE_BYTES) -> None:
        self._folder, self._limit_bytes, self._min_free_bytes = folder, limit_bytes, min_free_bytes
        sizes = [tree_size(each) for each in folder.iterdir()] if folder.is_dir() else []
        self._used, self._largest = sum(sizes), max(sizes, default=0)

    def add_episode(self, folder: Path) -> None:
        """Adds the files of an ended episode to the used space."""
        size = tree_size(folder)
        self._used += size
        self._largest = max(self._largest, size)

    def reason_to_stop(self, running: int) -> str:
        """Returns the reason why no episode may start; "" if an episode may start.

        Args:
            running: Number of running episodes; each is assumed to need as much space as the largest episode so far.
        """
        expected = (running + 1) * self._largest
        if self._used + expected > self._limit_bytes:
            return (
                f"the next episode would exceed --disk-limit {self._limit_bytes / GB:g}: {self._folder} has "
                f"{self._used / GB:.3g} GB"
            )
        existing_folder = next(path for path in (self._folder, *self._folder.parents) if path.is_dir())
        free = shutil.disk_usage(existing_folder).free
        if free - expected < self._min_free_bytes:
            return f"the disk of {existing_folder} is almost full: {free / GB:.3g} GB free"
        return ""


def tree_size(folder: Path) -> int:
    """Returns the total size of the files in a folder [B]."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir()) if folder.is_dir() else 0
