# SPDX-License-Identifier: BSD-3-Clause
"""Sets the folder of numba's cache; import this module before numba.

The folder lies in the user's cache folder, never in the source tree. Its name is a hash of all modules with compiled
kernels, because numba does not detect changes of functions that it has inlined from a different module.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
from pathlib import Path
from typing import Any


def cache_folder() -> Path:
    """Returns the cache folder for this version of the compiled kernels."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("compiled_*.py")):
        digest.update(source.read_bytes())
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "modular_framework_planning" / digest.hexdigest()[:16]


def cache_is_empty() -> bool:
    """Returns whether the cache contains no compiled kernel."""
    return not any(Path(os.environ["NUMBA_CACHE_DIR"]).rglob("*.nbi"))


def make_saves_exclusive() -> None:
    """Makes writes to the cache exclusive between processes.

    To save a kernel, numba reads an index, changes it and writes it back. Two processes that save the same kernel for
    different argument types would otherwise overwrite each other's entries.
    """
    from numba.core.caching import IndexDataCacheFile  # numba is imported after the folder is set

    cache_file: Any = IndexDataCacheFile
    save = cache_file.save

    @functools.wraps(save)
    def save_exclusively(file: Any, key: Any, data: Any) -> None:
        lock_path = Path(os.environ["NUMBA_CACHE_DIR"]) / "lock"
        lock_path.parent.mkdir(parents=True, exist_ok=True)
        with lock_path.open("w") as lock_file:
            fcntl.flock(lock_file, fcntl.LOCK_EX)
            save(file, key, data)

    cache_file.save = save_exclusively


os.environ.setdefault("NUMBA_CACHE_DIR", str(cache_folder()))
