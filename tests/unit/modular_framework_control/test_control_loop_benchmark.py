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


@pytest.mark.parametrize(
    ("late_ms", "cancel_ms", "faults"),
    [
        ([0.1, 0.2, 2.0], [3.0, 4.0, 20.0], []),
        ([0.1, 0.2, 2.1], [3.0, 4.0, 5.0], ["valid: a cycle began late by 2.1 ms, allowed 2 ms"]),
        ([0.1, 0.2, 0.3], [3.0, 4.0, 20.5], ["valid: a cancel took 20.5 ms, allowed 20 ms"]),
    ],
)
def test_the_bars_of_long_goals_hold_for_the_worst_repetition_and_name_the_lost_time(
    benchmark_module: ModuleType, late_ms: list[float], cancel_ms: list[float], faults: list[str]
) -> None:
    del benchmark_module  # makes the modules beside the benchmark importable
    from long_goals import LongGoalFigures, LostTime

    lost = LostTime(loop_ms=1.5, witness_ms=None, stolen_s=0.25, load=2.0)
    beside = " (without a processor: loop 1.5 ms, witness unknown; the host kept 0.25 s; load 2.0)"
    found = LongGoalFigures("valid", late_ms, cancel_ms, 1.0, lost).faults()
    assert found == [fault + beside for fault in faults]


@pytest.mark.parametrize("type_name", sorted(BUILT_IN_TYPES))
def test_an_update_is_measured(benchmark_module: ModuleType, type_name: str) -> None:
    assert benchmark_module.update_time(type_name, 6, 20) > 0.0
