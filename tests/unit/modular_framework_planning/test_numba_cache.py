# SPDX-License-Identifier: BSD-3-Clause
"""Processes that compile at the same time lose no entry of numba's cache."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path

import pytest
from numba.core.caching import IndexDataCacheFile

from modular_framework_planning.numba_cache import make_saves_exclusive


class Types(str):
    """Argument types of a loop, looked up in the index by two savers at the same moment if nothing prevents it."""

    both_read = threading.Barrier(2)

    def __hash__(self) -> int:
        with contextlib.suppress(threading.BrokenBarrierError):
            self.both_read.wait(0.5)
        return super().__hash__()

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        return str, (str(self),)


def test_two_saves_at_once_keep_both_entries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(IndexDataCacheFile, "save", IndexDataCacheFile.save)  # restored after the test
    make_saves_exclusive()
    files = [IndexDataCacheFile(str(tmp_path), "loop", "stamp") for _ in range(2)]
    threads = [
        threading.Thread(target=file.save, args=(Types(types), types)) for file, types in zip(files, "fi", strict=True)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [files[0].load(types) for types in "fi"] == ["f", "i"]
