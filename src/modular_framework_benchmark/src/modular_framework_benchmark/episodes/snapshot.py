# SPDX-License-Identifier: BSD-3-Clause
"""What an episode ran with: versions, machine, git revision."""

from __future__ import annotations

import functools
import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

PACKAGES = ("coal", "numpy", "ompl", "pin", "pybullet", "scipy", "toppra")
"""Packages whose versions change results."""

OF_ONE_EPISODE = (
    *("seed", "settings", "parameters", "final_objects", "metric_faults"),
    *("load_before", "load_after", "stolen_s", "busy_s"),
)
"""Parts of a snapshot that differ between the episodes of an experiment; the others should not."""


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


def machine_load() -> dict[str, float]:
    """Returns the load of the machine and the time its processors spent, in all and stolen by the hypervisor [s]."""
    ticks = [float(value) for value in _lines("/proc/stat")[0].split()[1:]]
    rate = os.sysconf("SC_CLK_TCK")
    return {
        "load_1_min": os.getloadavg()[0],
        "busy_s": (sum(ticks[:3]) + sum(ticks[5:8])) / rate,
        "stolen_s": (ticks[7] if len(ticks) > 7 else 0.0) / rate,
    }


def _lines(path: str) -> list[str]:
    return Path(path).read_text(errors="replace").splitlines()
