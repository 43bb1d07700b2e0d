# SPDX-License-Identifier: BSD-3-Clause
"""A process with many planning threads keeps its memory in few arenas and lets short requests in between."""

from __future__ import annotations

import subprocess
import sys

BUSY = """
import ctypes, sys, threading
from modular_framework_planning.process_setup import many_threads
if sys.argv[1] == "prepared":
    many_threads.prepare()
libc, all_here = ctypes.CDLL(None), threading.Barrier(8)
libc.malloc.restype = ctypes.c_void_p
def allocate():
    all_here.wait()
    for _ in range(2000):
        libc.malloc(1000)
    all_here.wait()
threads = [threading.Thread(target=allocate) for _ in range(8)]
for thread in threads: thread.start()
for thread in threads: thread.join()
print(sys.getswitchinterval(), flush=True)
libc.malloc_stats()
"""


def busy_process(mode: str) -> tuple[float, int]:
    """Returns the interpreter's switch interval [s] and the number of the C library's arenas."""
    ended = subprocess.run([sys.executable, "-c", BUSY, mode], capture_output=True, text=True, timeout=60.0, check=True)
    return float(ended.stdout), ended.stderr.count("Arena ")


def test_threads_share_two_arenas_and_wait_a_tenth_as_long_for_each_other() -> None:
    assert busy_process("as it is")[1] > 2, "the test would see more arenas"
    interval_s, arenas = busy_process("prepared")
    assert arenas <= 2 and interval_s <= 0.0005
