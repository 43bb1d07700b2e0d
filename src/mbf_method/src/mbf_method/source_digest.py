# SPDX-License-Identifier: BSD-3-Clause
"""Digest of the source files of a method, which identifies the version of the method in records."""

from __future__ import annotations

import hashlib
import sys
import sysconfig
import types
from pathlib import Path

INSTALLED = {"site-packages", "dist-packages"}
"""Folders of installed packages."""


def source_digest() -> str:
    """Returns the SHA-256 of the files of all imported modules, hexadecimal.

    The standard library, installed packages and this package are excluded. Modules that are imported later are missing.
    """
    lines = []
    for name, module in sorted(sys.modules.items()):
        path = _own_file(name, module)
        if path is not None:
            lines.append(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}")
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _own_file(name: str, module: object) -> Path | None:
    """Returns the file of a module of the method; None for other modules."""
    text = vars(module).get("__file__") if isinstance(module, types.ModuleType) else None
    if not isinstance(text, str) or name.partition(".")[0] == "mbf_method":
        return None
    path = Path(text)
    standard = {Path(sysconfig.get_path(kind)).resolve() for kind in ("stdlib", "platstdlib")}
    installed = INSTALLED.intersection(path.parts) or standard.intersection(path.resolve().parents)
    return path if path.is_file() and not installed else None
