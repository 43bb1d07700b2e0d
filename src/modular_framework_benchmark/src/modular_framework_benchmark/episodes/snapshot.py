# SPDX-License-Identifier: BSD-3-Clause
"""What an episode ran with: versions, machine, git revision."""

from __future__ import annotations

import functools
import os
import platform
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

PACKAGES = ("coal", "numpy", "ompl", "pin", "pybullet", "scipy", "toppra")
"""Packages whose versions change results."""

COLD_START = "cold_start"
"""Part of the snapshot of an episode that was the first one of its stack."""
NOT_SHOWN = ("seed", "settings", "parameters", "final_objects", COLD_START)
"""Parts of a snapshot that differ between episodes by nature."""
RUN_MARK = "MODULAR_FRAMEWORK_RUN"
"""Environment variable of every process that a run has started: RUN/WORKER."""


@functools.cache
def versions() -> dict[str, Any]:
    """Returns versions and the git revision of this software, the same for all episodes of a process."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = ""
    return {
        "version": _git("describe", "--always", "--dirty", "--tags"),
        "git_revision": _git("rev-parse", "HEAD"),
        "git_changed": bool(_git("status", "--porcelain", "--untracked-files=no")),
        "python": platform.python_version(),
        "ros_distribution": os.environ.get("ROS_DISTRO", ""),
        "packages": found,
    }


def _git(*arguments: str) -> str:
    """Returns what git says of the source tree; "" outside of one, such as in an install space."""
    try:
        done = subprocess.run(
            ["git", "-C", str(Path(__file__).resolve().parent), *arguments], capture_output=True, text=True, timeout=20
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


@functools.cache
def machine() -> dict[str, Any]:
    """Returns what the machine is."""
    names = [line.partition(":")[2].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")]
    return {
        "host": platform.node(),
        "cpu": names[0] if names else platform.processor(),
        "cores": len(os.sched_getaffinity(0)),
        "kernel": platform.release(),
        "memory_kb": int(next((line.split()[1] for line in _lines("/proc/meminfo")), "0")),
    }


@functools.cache
def reference_s() -> float:
    """Returns the seconds of a fixed workload on this machine, the least of five: what machines are compared by."""
    times = []
    for _ in range(5):
        start = time.perf_counter()
        values = np.random.default_rng(1).standard_normal((200, 200))
        for _ in range(20):
            values = np.tanh(values @ values)
        sum(number * number % 7 for number in range(200_000))
        times.append(time.perf_counter() - start)
    return round(min(times), 5)


@dataclass(frozen=True, slots=True)
class MachineLoad:
    """What the machine has done until a moment.

    Attributes:
        time_s: The moment, by the monotonic clock [s].
        load_1_min: Mean number of processes that ran or waited, over the last minute.
        busy_s: Time that its processors worked [s].
        stolen_s: Time that the hypervisor gave to others [s].
        others_s: Processor time of each process that is not of this run, by its identifier [s].
    """

    time_s: float
    load_1_min: float
    busy_s: float
    stolen_s: float
    others_s: Mapping[int, float]

    @classmethod
    def now(cls) -> MachineLoad:
        """Reads it from /proc."""
        ticks = [float(value) / _TICKS for value in _lines("/proc/stat")[0].split()[1:]]
        stolen_s = ticks[7] if len(ticks) > 7 else 0.0
        busy_s = sum(ticks[:3]) + sum(ticks[5:8])
        return cls(time.monotonic(), os.getloadavg()[0], busy_s, stolen_s, _others_s())

    def since(self, before: MachineLoad) -> dict[str, float]:
        """Returns the load of an episode: `others_share` is the fraction of the machine that other processes used."""
        others_s = sum(max(spent - before.others_s.get(pid, 0.0), 0.0) for pid, spent in self.others_s.items())
        available_s = max(self.time_s - before.time_s, 1e-3) * len(os.sched_getaffinity(0))
        return {
            "load_before": before.load_1_min,
            "load_after": self.load_1_min,
            "stolen_s": round(self.stolen_s - before.stolen_s, 2),
            "busy_s": round(self.busy_s - before.busy_s, 2),
            "others_share": round(others_s / available_s, 3),
        }


_TICKS = os.sysconf("SC_CLK_TCK")


def _others_s() -> dict[int, float]:
    own, found = {os.getpid(), os.getppid()}, {}
    run = f"{RUN_MARK}={os.environ.get(RUN_MARK, '').partition('/')[0]}".encode()
    for folder in Path("/proc").iterdir():
        try:
            if not folder.name.isdigit() or int(folder.name) in own or _is_of_run(folder, run):
                continue
            # the name in brackets may have spaces
            fields = (folder / "stat").read_text(errors="replace").rpartition(")")[2].split()
            found[int(folder.name)] = (float(fields[11]) + float(fields[12])) / _TICKS
        except OSError:  # it has ended
            continue
    return found


def _is_of_run(process: Path, run: bytes) -> bool:
    try:
        environment = (process / "environ").read_bytes()
    except PermissionError:  # another user's
        return False
    return any(variable.startswith(run) for variable in environment.split(b"\0"))


def _lines(path: str) -> list[str]:
    return Path(path).read_text(errors="replace").splitlines()
