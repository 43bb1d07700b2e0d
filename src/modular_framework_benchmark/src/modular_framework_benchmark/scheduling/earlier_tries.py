# SPDX-License-Identifier: BSD-3-Clause
"""Notes each try of an episode in a file beside its folder, so that a try that was killed leaves a trace."""

from __future__ import annotations

import datetime
import platform
from pathlib import Path

EARLIER_TRIES = "earlier_tries"
"""Part of the snapshot with a text for each try that gave no record."""


def begin_try(folder: Path) -> list[str]:
    """Notes that a try begins; returns the texts of the earlier ones.

    Args:
        folder: Of the episode; what is above it is there.
    """
    earlier = _notes(folder).read_text(encoding="utf-8").splitlines() if _notes(folder).is_file() else []
    now = datetime.datetime.now(datetime.UTC).isoformat(" ", "seconds")
    _add(folder, f"\nbegun {now} on {platform.node()}")
    return [text for text in earlier if text]


def end_try(folder: Path, cause: str) -> None:
    """Notes why the last try ended without a record."""
    _add(folder, f": {' '.join(cause.split())}")


def forget_tries(folder: Path) -> None:
    """Removes the notes of an episode whose record is stored."""
    _notes(folder).unlink(missing_ok=True)


def _notes(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.tries")


def _add(folder: Path, text: str) -> None:
    with _notes(folder).open("a", encoding="utf-8") as stream:
        stream.write(text)
