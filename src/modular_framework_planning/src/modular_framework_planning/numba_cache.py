# SPDX-License-Identifier: BSD-3-Clause
"""Chooses the folder in which numba caches compiled loops; to be imported before numba.

The folder is below the user's cache folder, never in the source tree, and is named after the contents of every module
with compiled loops: numba does not notice that a function which it inlined from another module has changed.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
from pathlib import Path
from typing import Any


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


def make_saves_exclusive() -> None:
    """Lets only one process at a time write to the cache.

    To save a loop, numba reads an index, changes it and writes it back. Two processes that save the same loop for other
    argument types would overwrite each other's entries.
    """
    from numba.core.caching import IndexDataCacheFile  # imported here, see above

    cache_file: Any = IndexDataCacheFile
    save = cache_file.save

    @functools.wraps(save)
    def save_exclusively(file: Any, key: Any, data: Any) -> None:
        lock = Path(os.environ["NUMBA_CACHE_DIR"]) / "lock"
        lock.parent.mkdir(parents=True, exist_ok=True)
        with lock.open("w") as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            save(file, key, data)

    cache_file.save = save_exclusively


os.environ.setdefault("NUMBA_CACHE_DIR", str(cache_folder()))
