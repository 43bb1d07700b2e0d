# SPDX-License-Identifier: BSD-3-Clause
"""The results of suites: the counts of one run from what pytest and rostest wrote, and the table of repeated runs."""

from __future__ import annotations

import contextlib
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

NO_TESTS_COLLECTED = 5


@dataclass(frozen=True)
class Count:
    """Numbers of tests that passed, failed and were skipped."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def __add__(self, other: Count) -> Count:
        return Count(self.passed + other.passed, self.failed + other.failed, self.skipped + other.skipped)

    def __str__(self) -> str:
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"


@dataclass(frozen=True)
class SuiteRun:
    """The result of one run of a suite.

    Attributes:
        name: Name of the suite.
        count: Counts of its tests.
        failed_tests: Names of the failed tests.
        log: The run's output.
    """

    name: str
    count: Count
    failed_tests: tuple[str, ...]
    log: Path


def count_of(code: int, results: Path, log: str) -> Count:
    """Counts the tests of one run.

    A run that ended badly without a failed test counts as one failure. A run without any test does too, unless the
    user's arguments for pytest deselected all tests.

    Args:
        code: Exit code of the suite.
        results: Folder with the reports of pytest and rostest.
        log: The run's output.
    """
    count = Count()
    for suite in _reported_suites(results):
        total, skipped = int(suite.get("tests", 0)), int(suite.get("skipped", 0))
        failed = int(suite.get("failures", 0)) + int(suite.get("errors", 0))
        count += Count(total - skipped - failed, failed, skipped)
    ended_badly = code not in (0, NO_TESTS_COLLECTED) and not count.failed
    is_empty = count == Count() and not re.search(r"^\d+ deselected\b.* in ", log, re.MULTILINE)
    return count + Count(failed=ended_badly or is_empty)


def failed_tests_of(results: Path) -> tuple[str, ...]:
    """Returns the names of the failed tests in the reports of a run."""
    return tuple(
        str(case.get("name"))
        for suite in _reported_suites(results)
        for case in suite.iter("testcase")
        if case.find("failure") is not None or case.find("error") is not None
    )


def repetition_table(runs: Iterable[SuiteRun]) -> list[str]:
    """Returns a line for each suite: passed runs of all runs, then each failed test with its number of failures."""
    by_suite: dict[str, list[SuiteRun]] = {}
    for run in runs:
        by_suite.setdefault(run.name, []).append(run)
    lines = []
    for name, of_suite in by_suite.items():
        failed = [run for run in of_suite if run.count.failed]
        lines.append(f"{name}: {len(of_suite) - len(failed)} of {len(of_suite)} runs passed")
        tests = Counter(test for run in failed for test in run.failed_tests or ("no test: the suite ended badly",))
        for test, failures in tests.most_common():
            logs = [run.log.name for run in failed if test in run.failed_tests or not run.failed_tests]
            lines.append(f"    {failures} x {test} ({', '.join(logs)})")
    return lines


def _reported_suites(results: Path) -> Iterator[ElementTree.Element]:
    for report in sorted(results.glob("**/rosunit-*.xml")):
        with contextlib.suppress(ElementTree.ParseError):  # pytest ended before it had written the whole report
            yield from ElementTree.parse(report).getroot().iter("testsuite")
