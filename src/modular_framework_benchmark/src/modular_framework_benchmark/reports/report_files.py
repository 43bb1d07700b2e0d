# SPDX-License-Identifier: BSD-3-Clause
"""Writes a file whole, or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from modular_framework_benchmark.reports.errors import ReportError


def write_file(path: Path, content: bytes) -> None:
    """Writes a file; one that was there stays until the new one is complete.

    Raises:
        ReportError: when it cannot be written.
    """
    written = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.absolute().parent, prefix=f".{path.name}.", delete=False) as file:
            written = Path(file.name)
            file.write(content)
        mask = os.umask(0)
        os.umask(mask)
        written.chmod(0o666 & ~mask)
        written.replace(path)
    except OSError as error:
        if written is not None:
            with contextlib.suppress(OSError):
                written.unlink()
        raise ReportError(
            f"{path}: {error.strerror}; name a file in a folder that is there and can be written"
        ) from error
