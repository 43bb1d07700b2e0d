# SPDX-License-Identifier: BSD-3-Clause
"""Writes files atomically."""

from __future__ import annotations

from pathlib import Path

from modular_framework_benchmark.reports.errors import ReportError
from modular_framework_core.files.atomic_files import write_atomically


def write_file(path: Path, content: bytes) -> None:
    """Writes a file; an existing file is kept until the new file is complete.

    Raises:
        ReportError: The file is not writable.
    """
    try:
        write_atomically(path, content)
    except OSError as error:
        raise ReportError(f"{path}: {error.strerror}") from error
