# SPDX-License-Identifier: BSD-3-Clause
"""Checks of the computer and of the installed packages."""

from __future__ import annotations

import os
import platform
import re
import resource
import shutil
import socket
import subprocess
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import psutil

from modular_framework_core.diagnosis.findings import Finding, fault, note, ok

DEBIAN_PACKAGES, PYTHON_PACKAGES = "packages-debian.txt", "requirements.txt"
"""Files of a checkout that name the packages which `install.sh` installs."""
LEAST_DISK_GB, LEAST_MEMORY_GB = 1.0, 1.5
SHOWN_NAMES = 8
REQUIREMENT = re.compile(r"([A-Za-z0-9._-]+)==([^\s;\\]+)")
GB = 1e9


def find_checkout(folder: Path) -> Path | None:
    """Returns the checkout of the framework that contains a folder; None for an install space without a checkout."""
    folder = folder.resolve()
    return next((path for path in (folder, *folder.parents) if (path / DEBIAN_PACKAGES).is_file()), None)


def installation_findings(checkout: Path | None, records: Path) -> Iterator[Finding]:
    """Yields the findings about the computer and its packages.

    Args:
        checkout: Checkout of the framework; None if unknown.
        records: Folder in which the framework writes records.
    """
    if checkout is None:
        yield note("The framework runs from an install space, so its packages are not compared with its lists.")
    else:
        yield _debian_packages(checkout / DEBIAN_PACKAGES)
        yield _python_packages(checkout / PYTHON_PACKAGES)
    yield _disk_space(records)
    yield _memory()
    yield _host_name()
    yield _display()
    yield _priority()


def computer_lines(checkout: Path | None) -> Iterator[str]:
    """Yields lines that describe the computer and the version of the framework."""
    yield f"system: {platform.freedesktop_os_release().get('PRETTY_NAME', 'unknown')}, kernel {platform.release()}"
    yield f"processors: {os.cpu_count()} ({platform.machine()}), memory {psutil.virtual_memory().total / GB:.1f} GB"
    yield f"Python: {platform.python_version()}"
    if checkout is not None and shutil.which("git"):
        command = ["git", "-C", str(checkout), "describe", "--always", "--dirty"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        yield f"commit: {run.stdout.strip() or 'unknown'}"
    for name in ("ROS_DISTRO", "ROS_MASTER_URI", "ROS_IP", "ROS_HOSTNAME", "ROS_HOME", "DISPLAY"):
        yield f"{name}: {os.environ.get(name, 'not set')}"


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:SHOWN_NAMES])
    return shown if len(names) <= SHOWN_NAMES else f"{shown} and {len(names) - SHOWN_NAMES} more"


def _debian_packages(file: Path) -> Finding:
    lines = [line.strip() for line in file.read_text().splitlines()]
    names = [line for line in lines if line and not line.startswith("#")]
    command = ["dpkg-query", "--show", "--showformat=${Package} ${db:Status-Status}\n"]
    try:
        listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        return note(f"The Debian packages cannot be listed ({error}).", anchor="installation")
    installed = {line.split()[0] for line in listing.splitlines() if line.endswith(" installed")}
    missing = [name for name in names if name not in installed]
    if missing:
        return fault(f"{len(missing)} Debian packages are missing: {_listed(missing)}.", "./install.sh", "installation")
    return ok(f"All {len(names)} Debian packages are installed.")


def _python_packages(file: Path) -> Finding:
    matches = map(REQUIREMENT.match, file.read_text().splitlines())
    wanted = {match[1]: match[2] for match in matches if match}
    wrong = []
    for name, version in wanted.items():
        try:
            found = metadata.version(name)
        except metadata.PackageNotFoundError:
            found = "none"
        if found != version:
            wrong.append(f"{name} {found} instead of {version}")
    if wrong:
        return fault(
            f"{len(wrong)} of {len(wanted)} Python packages differ from {file.name}: {_listed(wrong)}.",
            "./install.sh; if it says that the environment is up to date, remove the folder .venv first",
            "installation",
        )
    return ok(f"All {len(wanted)} Python packages have the versions of {file.name}.")


def _disk_space(folder: Path) -> Finding:
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    free_gb = shutil.disk_usage(existing).free / GB
    if not os.access(existing, os.W_OK):
        return fault(f"You may not write to {existing}, where records go.", "set ROS_HOME", "installation")
    if free_gb < LEAST_DISK_GB:
        return fault(
            f"{free_gb:.1f} GB of disk space are free at {existing}, where records go.",
            f"free at least {LEAST_DISK_GB:g} GB, or set ROS_HOME",
            "installation",
        )
    return ok(f"{free_gb:.0f} GB of disk space are free for records.")


def _memory() -> Finding:
    free_gb = psutil.virtual_memory().available / GB
    if free_gb < LEAST_MEMORY_GB:
        return fault(
            f"{free_gb:.1f} GB of memory are available; a simulated pick needs {LEAST_MEMORY_GB:g} GB.",
            "end other programs",
            "installation",
        )
    return ok(f"{free_gb:.1f} GB of memory are available.")


def _host_name() -> Finding:
    names = [name for name in ("ROS_IP", "ROS_HOSTNAME") if os.environ.get(name)]
    if names:
        return ok(f"Nodes listen at the address in {names[0]}, {os.environ[names[0]]}.")
    name = socket.gethostname()
    try:
        address = socket.gethostbyname(name)
    except OSError:
        return fault(f"The host name {name} has no address.", "export ROS_IP=127.0.0.1", "start")
    return ok(f"Nodes listen at the address of the host name, {address}.")


def _display() -> Finding:
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        return ok("There is a display for RViz and the simulator.")
    return note("There is no display: RViz and the window of the simulator stay closed.", anchor="start")


def _priority() -> Finding:
    if os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] > 0:
        return ok("The control loop of a real robot may have real-time priority.")
    return note("The control loop of a real robot cannot have real-time priority (ulimit -r is 0).", anchor="robot")
