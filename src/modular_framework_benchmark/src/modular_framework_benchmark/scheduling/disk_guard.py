# SPDX-License-Identifier: BSD-3-Clause
"""Ends a run cleanly before the disk is full, or before its records take more than they may."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

MIN_FREE_BYTES = 500e6
"""What stays free on the disk, for the database, the report and everybody else."""
GB = 1e9


class DiskGuard:
    """Watches the folders of episodes.

    Args:
        folder: Folder with the folders of the episodes; it need not be there yet.
        limit_bytes: What all of them may take.
        min_free_bytes: What has to stay free on their disk.
    """

    def __init__(self, folder: Path, limit_bytes: float = math.inf, min_free_bytes: float = MIN_FREE_BYTES) -> None:
        self._folder, self._limit_bytes, self._min_free_bytes = folder, limit_bytes, min_free_bytes
        sizes = [tree_size(each) for each in folder.iterdir()] if folder.is_dir() else []
        self._used, self._largest = sum(sizes), max(sizes, default=0)

    def ended(self, folder: Path) -> None:
        """Counts the files of an episode that has ended."""
        size = tree_size(folder)
        self._used += size
        self._largest = max(self._largest, size)

    def reason_to_stop(self, running: int) -> str:
        """Returns why no further episode may begin; "" if one may.

        Args:
            running: Episodes that run: each is expected to take as much as the largest so far, and so is the next one.
        """
        expected = (running + 1) * self._largest
        if self._used + expected > self._limit_bytes:
            return (
                f"the next episode would exceed --disk-limit {self._limit_bytes / GB:g}: {self._folder} has "
                f"{self._used / GB:.3g} GB"
            )
        there = next(path for path in (self._folder, *self._folder.parents) if path.is_dir())
        free = shutil.disk_usage(there).free
        if free - expected < self._min_free_bytes:
            return f"the disk of {there} is almost full: {free / GB:.3g} GB are free"
        return ""


def tree_size(folder: Path) -> int:
    """Returns the size of all files below a folder [B]."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir()) if folder.is_dir() else 0
