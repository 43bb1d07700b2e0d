# SPDX-License-Identifier: BSD-3-Clause
"""Suites and tests that `./install.sh test` leaves out and `./install.sh test full` runs, from `full_only.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

TESTS = Path(__file__).resolve().parent  # as tests/run resolves the paths of suites
LEAVE_OUT = "LEAVE_OUT_FULL_ONLY"
"""Environment variable with which tests/run has the conftest module leave out the tests."""


class Item(Protocol):
    """What a collected test needs here."""

    @property
    def path(self) -> Path: ...

    @property
    def name(self) -> str: ...


Test = TypeVar("Test", bound=Item)


@dataclass(frozen=True)
class FullOnly:
    """What is left out of a file.

    Attributes:
        path: File of the suite or of the test module.
        tests: Names of tests, with or without parameters; empty if the whole suite is left out.
        reason: Test that shows the same behaviour in the short run.
    """

    path: Path
    tests: tuple[str, ...]
    reason: str

    def takes(self, item: Item) -> bool:
        """Whether a collected test is left out."""
        return item.path == self.path and bool({item.name, item.name.partition("[")[0]} & set(self.tests))


def read_full_only(file: Path = TESTS / "full_only.toml") -> tuple[FullOnly, ...]:
    """Reads the list."""
    entries = tomllib.loads(file.read_text())
    return tuple(
        FullOnly(TESTS / path, tuple(entry.get("tests", ())), entry["reason"]) for path, entry in entries.items()
    )


def split_items(items: Iterable[Test], entries: Iterable[FullOnly]) -> tuple[list[Test], list[Test]]:
    """Returns the tests that run and those that are left out.

    Raises:
        ValueError: An entry names a test that its module does not have.
    """
    items = list(items)
    for entry in entries:
        names = {name for item in items if item.path == entry.path for name in (item.name, item.name.partition("[")[0])}
        if names and (unknown := set(entry.tests) - names):
            raise ValueError(f"tests/full_only.toml: {entry.path} has no test {sorted(unknown)}; correct the name")
    left_out = [item for item in items if any(entry.takes(item) for entry in entries)]
    return [item for item in items if item not in left_out], left_out
