# SPDX-License-Identifier: BSD-3-Clause
"""Identifies methods that run in their own process: their names, the files in their commands, and their folders."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from modular_framework_benchmark.episodes.ros_file_digests import file_digest, portable_name
from modular_framework_benchmark.episodes.ros_package_sources import EXCLUDED_NAMES


def command_words(command: object) -> tuple[str, ...]:
    """Returns the words of a command; empty for a value that is not a list."""
    return tuple(map(str, command)) if isinstance(command, list | tuple) else ()


def method_name(command: object, address: object) -> str:
    """Returns a name that does not depend on the machine; "" for a method without command and address.

    Args:
        command: Program and arguments that start the method.
        address: Address of a running method.
    """
    words = command_words(command)
    return " ".join(portable_name(Path(word)) if word.startswith("/") else word for word in words) or str(address or "")


def command_files(command: object) -> list[Path]:
    """Returns the existing files that a command names by absolute path."""
    paths = [Path(word) for word in command_words(command)]
    return [path for path in paths if path.is_absolute() and path.is_file()]


def folder_digest(script: Path) -> str:
    """Returns the SHA-256 of the Python files in the folder of a script, and in its subfolders with Python files."""
    lines = [f"{path.relative_to(script.parent)} {file_digest(path)}" for path in _python_files(script.parent)]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _python_files(folder: Path) -> Iterator[Path]:
    """Yields Python files; environments, links, caches and tests are excluded."""
    for path in sorted(folder.iterdir()):
        if path.suffix == ".py" and path.is_file():
            yield path
        elif path.is_dir() and not path.is_symlink() and path.name not in EXCLUDED_NAMES and any(path.glob("*.py")):
            yield from _python_files(path)
