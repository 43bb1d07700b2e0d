# SPDX-License-Identifier: BSD-3-Clause
"""`benchmarks/control_loop` measures controllers of every type there is."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from modular_framework_control.controller_manager.controller_types import BUILT_IN_TYPES

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"


@pytest.fixture(scope="module")
def benchmark_module() -> Iterator[ModuleType]:
    """The benchmark, which is a script without a suffix."""
    loader = importlib.machinery.SourceFileLoader("control_loop_benchmark", str(BENCHMARKS / "control_loop"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    path = list(sys.path)
    sys.path.insert(0, str(BENCHMARKS))
    loader.exec_module(module)
    yield module
    sys.path[:] = path


@pytest.mark.parametrize("type_name", sorted(BUILT_IN_TYPES))
def test_an_update_is_measured(benchmark_module: ModuleType, type_name: str) -> None:
    assert benchmark_module.update_time(type_name, 6, 20) > 0.0
