# SPDX-License-Identifier: BSD-3-Clause
"""Finds imports of modules of the tests outside the tests."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from layer_checks import fault

_IMPORT = re.compile(r"^[ \t]*(?:from|import) (\w+)", re.MULTILINE)
_TESTING = "src/modular_framework_testing"


def imports_of_tests(root: Path, files: Iterable[str]) -> Iterator[str]:
    """Returns the faults of files that import a module by the name of one of `tests/`.

    Args:
        root: Folder of the project.
        files: Paths of Python files, relative to the root.
    """
    tests = {path.stem: path for path in (root / "tests").rglob("*.py")}
    for file in files:
        text = (root / file).read_text(encoding="utf-8")
        for match in _IMPORT.finditer(text):
            path = tests.get(match[1])
            if path is not None and not (root / file).with_name(path.name).exists():
                yield fault(
                    f"{file}:{text.count(chr(10), 0, match.start()) + 1}",
                    f"imports {path.relative_to(root)}",
                    "packages of src and modules beside it",
                    f"move the module to {_TESTING}",
                )


def python_files(root: Path, listed: Iterable[str]) -> list[str]:
    """Returns the Python files of a list: by their ending, or by the first line of executables without an ending."""
    return [file for file in listed if _is_python(root / file)]


def _is_python(path: Path) -> bool:
    if path.suffix:
        return path.suffix == ".py"
    with path.open("rb") as file:
        return b"python" in file.readline()
