# SPDX-License-Identifier: BSD-3-Clause
"""The exit code of `benchmarks/gripper_geometry` demands enough models that open as far as their makers say."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[3] / "benchmarks" / "gripper_geometry"


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    loader = importlib.machinery.SourceFileLoader("gripper_geometry_benchmark", str(SCRIPT))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = sys.modules[loader.name] = importlib.util.module_from_spec(spec)
    sys.path.append(str(SCRIPT.parent))
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("within", "outside", "required", "code"), [(7, 0, 7, 0), (6, 0, 7, 1), (8, 1, 7, 1), (2, 0, 1, 0), (0, 0, 1, 1)]
)
def test_models_without_a_figure_or_with_a_known_deviation_do_not_count(
    within: int, outside: int, required: int, code: int, benchmark: ModuleType
) -> None:
    openings = [(100.0, "")] * within + [(50.0, "")] * outside + [(None, "")] + [(50.0, "its joint ends at 99 mm")]
    rows = [benchmark.Row(f"gripper {n}", *found) for n, found in enumerate(
        (published, 99.0, 0.0, ("left", "right"), deviation) for published, deviation in openings
    )]  # fmt: skip
    assert benchmark.exit_code(rows, required) == code
