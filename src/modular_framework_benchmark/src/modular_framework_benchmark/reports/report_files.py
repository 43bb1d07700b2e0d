# SPDX-License-Identifier: BSD-3-Clause
"""Writes a file whole, or not at all."""

from __future__ import annotations

from pathlib import Path

from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_core.files.atomic_files import write_atomically


def write_file(path: Path, content: bytes) -> None:
    """Writes a file; one that was there stays until the new one is complete.

    Raises:
        ReportError: when it cannot be written.
    """
    try:
        write_atomically(path, content)
    except OSError as error:
        raise ReportError(f"{path}: {error.strerror}") from error
