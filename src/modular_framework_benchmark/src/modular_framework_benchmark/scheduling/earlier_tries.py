# SPDX-License-Identifier: BSD-3-Clause
"""Log of an episode's attempts, in a file beside its folder, so that a killed attempt leaves a trace."""

from __future__ import annotations

import datetime
import platform
from pathlib import Path

EARLIER_TRIES = "earlier_tries"
"""Snapshot part with a text for each attempt without a record."""
LOST = "the worker, the run or the machine was lost during the attempt"
"""Cause of an attempt whose end nobody logged, as for a lost worker of a Dask cluster."""


def begin_try(folder: Path) -> list[str]:
    """Logs the start of an attempt; returns the texts of earlier attempts.

    Args:
        folder: Folder of the episode, whose parent exists.
    """
    earlier = _texts(folder)
    if earlier and ": " not in earlier[-1]:
        end_try(folder, LOST)
        earlier = _texts(folder)
    now = datetime.datetime.now(datetime.UTC).isoformat(" ", "seconds")
    _append_note(folder, f"\nbegun {now} on {platform.node()}")
    return earlier


def end_try(folder: Path, cause: str) -> None:
    """Logs why the latest attempt ended without a record."""
    _append_note(folder, f": {' '.join(cause.split())}")


def forget_tries(folder: Path) -> None:
    """Removes the log of an episode whose record is stored."""
    _notes(folder).unlink(missing_ok=True)


def _notes(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.tries")


def _texts(folder: Path) -> list[str]:
    notes = _notes(folder)
    return [text for text in notes.read_text(encoding="utf-8").splitlines() if text] if notes.is_file() else []


def _append_note(folder: Path, text: str) -> None:
    with _notes(folder).open("a", encoding="utf-8") as stream:
        stream.write(text)
