# SPDX-License-Identifier: BSD-3-Clause
"""Parts of a snapshot that the episodes of all modes record: versions, machine, load, seed and settings."""

from __future__ import annotations

import contextlib
import functools
import hashlib
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
import psutil
import rospkg

from modular_framework_benchmark.records.episode import EpisodeSpec
from modular_framework_benchmark.records.episode_settings import as_json
from modular_framework_benchmark.records.results import WORKER_COUNT
from modular_framework_core.launching.launch_session import environment_of

RECORDED_PACKAGES = ("coal", "eaik", "mujoco", "numba", "numpy", "ompl", "pin", "pybullet", "scipy", "toppra")
"""Python packages whose versions affect results."""

ROS_PACKAGES = ("actionlib", "genpy", "robot_state_publisher", "roscpp", "rosgraph", "roslaunch", "rospy", "tf2_ros")
"""ROS packages whose versions affect results."""
RUN_ID_VARIABLE = "MODULAR_FRAMEWORK_RUN"
"""Environment variable that identifies the run of a process, as RUN/WORKER."""


@functools.cache
def versions() -> dict[str, Any]:
    """Returns the git revision of this software and the versions of its environment; constant within a process."""
    return {
        "version": _git("describe", "--always", "--dirty", "--tags"),
        "git_revision": _git("rev-parse", "HEAD"),
        "git_changed": bool(_git("status", "--porcelain", "--untracked-files=no")),
        "python": platform.python_version(),
        "ros_distribution": os.environ.get("ROS_DISTRO", ""),
        "packages": {name: package_version(name) for name in RECORDED_PACKAGES},
        "ros_packages": {name: _ros_version(name) for name in ROS_PACKAGES},
        "environment": _environment_digest(),
    }


def package_version(name: str) -> str:
    """Returns the version of a Python package, "" for a missing package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _ros_version(package: str) -> str:
    """Returns the version of a ROS package, "" for a missing package."""
    try:
        return str(rospkg.RosPack.get_instance().get_manifest(package).version)
    except rospkg.ResourceNotFound:
        return ""


def _environment_digest() -> str:
    """Returns the hexadecimal SHA-256 of the names and versions of all Python packages of this environment."""
    package_versions = sorted({f"{package.name}=={package.version}" for package in metadata.distributions()})
    return hashlib.sha256("\n".join(package_versions).encode()).hexdigest()


def _git(*arguments: str) -> str:
    """Returns the output of git for the source tree; "" outside a repository, such as in an install space."""
    try:
        process = subprocess.run(
            ["git", "-C", str(Path(__file__).resolve().parent), *arguments], capture_output=True, text=True, timeout=20
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return process.stdout.strip() if process.returncode == 0 else ""


@functools.cache
def machine() -> dict[str, Any]:
    """Returns the properties of the machine."""
    lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    cpu_names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "host": platform.node(),
        "cpu": cpu_names[0] if cpu_names else platform.processor(),
        "cores": len(os.sched_getaffinity(0)),
        "kernel": platform.release(),
        "memory_kb": psutil.virtual_memory().total // 1024,
    }


@functools.cache
def reference_s() -> float:
    """Returns the minimum duration of a fixed workload in five runs [s], for comparisons of the speed of machines."""
    durations_s = []
    for _ in range(5):
        start = time.perf_counter()
        values = np.random.default_rng(1).standard_normal((200, 200))
        for _ in range(20):
            values = np.tanh(values @ values)
        sum(number * number % 7 for number in range(200_000))
        durations_s.append(time.perf_counter() - start)
    return round(min(durations_s), 5)


@dataclass(frozen=True, slots=True)
class MachineLoad:
    """Counters of the machine at a moment.

    Attributes:
        time_s: Time on the monotonic clock [s].
        load_1_min: Load average over the last minute.
        busy_s: Busy time of the processors [s].
        stolen_s: Processor time that the hypervisor gave to other machines [s].
        others_s: Processor time of each process outside this run [s], keyed by process id.
        workers_s: Processor time of each other worker of this run on this machine [s], keyed by the worker's mark.
    """

    time_s: float
    load_1_min: float
    busy_s: float
    stolen_s: float
    others_s: Mapping[int, float]
    workers_s: Mapping[str, float]

    @classmethod
    def now(cls) -> MachineLoad:
        """Reads the counters."""
        times = psutil.cpu_times()
        busy_s = times.user + times.nice + times.system + times.irq + times.softirq + times.steal
        return cls(time.monotonic(), os.getloadavg()[0], busy_s, times.steal, *_processor_times())

    def since(self, before: MachineLoad) -> dict[str, float]:
        """Returns the load since an earlier moment.

        `others_share` is the fraction of the machine that processes outside this run used, and `workers_share` the
        fraction that the other workers of this run used.
        """
        others_s = sum(max(spent - before.others_s.get(pid, 0.0), 0.0) for pid, spent in self.others_s.items())
        workers_s = sum(max(spent - before.workers_s.get(mark, 0.0), 0.0) for mark, spent in self.workers_s.items())
        available_s = max(self.time_s - before.time_s, 1e-3) * len(os.sched_getaffinity(0))
        return {
            "load_before": before.load_1_min,
            "load_after": self.load_1_min,
            "stolen_s": round(self.stolen_s - before.stolen_s, 2),
            "busy_s": round(self.busy_s - before.busy_s, 2),
            "others_share": round(others_s / available_s, 3),
            "workers_share": round(workers_s / available_s, 3),
            WORKER_COUNT: 1 + max(len(before.workers_s), len(self.workers_s)),
        }


def common_parts(spec: EpisodeSpec, load: MachineLoad) -> dict[str, Any]:
    """Returns the snapshot parts that every mode records.

    Args:
        spec: Specification of the episode.
        load: Load of the machine at the start of the episode.
    """
    return {
        **versions(),
        "machine": machine(),
        "reference_s": reference_s(),
        **MachineLoad.now().since(load),
        "seed": spec.seed,
        "settings": as_json(spec.settings),
    }


def _processor_times() -> tuple[dict[int, float], dict[str, float]]:
    """Returns the fields `others_s` and `workers_s` of `MachineLoad`.

    The time of a worker includes its ended processes, such as the processes that each compute one plan.
    """
    excluded, others_s, workers_s = {os.getpid(), os.getppid()}, dict[int, float](), dict[str, float]()
    own_run, own_worker = _run_and_worker(os.environ.get(RUN_ID_VARIABLE, ""))
    for process in psutil.process_iter():
        with contextlib.suppress(OSError, psutil.Error):  # the process has ended
            run, worker = _run_and_worker(_mark(Path(f"/proc/{process.pid}")))
            times = process.cpu_times()
            if process.pid in excluded or (run and (run, worker) == (own_run, own_worker)):
                continue
            if run and run == own_run:
                used_s = times.user + times.system + times.children_user + times.children_system
                workers_s[worker] = workers_s.get(worker, 0.0) + used_s
            else:
                others_s[process.pid] = times.user + times.system
    return others_s, workers_s


def _run_and_worker(mark: str) -> tuple[str, str]:
    """Returns the run and the worker of a mark RUN/WORKER/; empty texts without a mark."""
    run, _, rest = mark.partition("/")
    return run, rest.partition("/")[0]


def _mark(process_folder: Path) -> str:
    """Returns the mark in the environment of a process; "" without a mark, or for the process of a different user."""
    try:
        environment = environment_of(process_folder)
    except PermissionError:
        return ""
    prefix = f"{RUN_ID_VARIABLE}=".encode()
    marks = (variable for variable in environment.split(b"\0") if variable.startswith(prefix))
    return next(marks, b"").removeprefix(prefix).decode(errors="replace")
