# SPDX-License-Identifier: BSD-3-Clause
"""Chooses the folder in which numba caches compiled loops; to be imported before numba.

The folder is below the user's cache folder, never in the source tree, and is named after the contents of every module
with compiled loops: numba does not notice that a function which it inlined from another module has changed.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path


def cache_folder() -> Path:
    """Returns the folder of this version of the compiled loops."""
    contents = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("compiled_*.py")):
        contents.update(source.read_bytes())
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "modular_framework_planning" / contents.hexdigest()[:16]


def cache_is_empty() -> bool:
    """Whether nothing has been compiled yet."""
    return not any(Path(os.environ["NUMBA_CACHE_DIR"]).rglob("*.nbi"))


os.environ.setdefault("NUMBA_CACHE_DIR", str(cache_folder()))
