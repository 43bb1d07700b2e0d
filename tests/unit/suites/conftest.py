# SPDX-License-Identifier: BSD-3-Clause
"""The script tests/run as a module, and suites that it runs in a moment."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

import pytest

TESTS = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def runner() -> Iterator[ModuleType]:
    """The script tests/run as a module."""
    loader = SourceFileLoader("tests_run", str(TESTS / "run"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, loader.name, module)
        patch.syspath_prepend(TESTS)
        patch.setattr(sys, "dont_write_bytecode", True)
        loader.exec_module(module)
        yield module


@pytest.fixture
def scripted(runner: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A kind of suites that run in a moment: a steady one, and one that fails in its second run only."""
    paths = [tmp_path / name for name in ("steady.py", "flaky.py")]
    for path in paths:
        path.write_text(
            "from pathlib import Path\n"
            "def test_it():\n"
            "    runs = Path(__file__).with_suffix('.runs')\n"
            "    runs.write_text(runs.read_text() + 'x' if runs.exists() else 'x')\n"
            f"    assert {path.name!r} == 'steady.py' or runs.read_text() != 'xx', 'the second run'\n"
        )
    suites = [runner.Suite(f"unit/{path.stem}", path) for path in paths]
    monkeypatch.setattr(runner, "suites_of", lambda kind: suites if kind == "unit" else [])
    monkeypatch.setattr(runner, "ROOT", tmp_path)
    monkeypatch.setattr(runner, "LOGS", tmp_path / "logs")
    monkeypatch.setattr(runner.subprocess, "run", lambda *_, **__: None)  # no loops to compile
    monkeypatch.setenv("PYTEST_ADDOPTS", "-p no:cacheprovider")
    return tmp_path
