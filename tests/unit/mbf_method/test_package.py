# SPDX-License-Identifier: BSD-3-Clause
"""The package works in a foreign environment: Python 3.8, without ROS, with the documented example."""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from mbf_method import GraspRequest
from mbf_method.grasps import checked_grasps
from mbf_method.wire import pack, unpack

ROOT = Path(__file__).parents[3]
EXAMPLE, PLANNER, POLICY = (
    ROOT / f"docs/examples/{name}.py" for name in ("my_grasp_method", "my_planner", "my_policy")
)
MODULES = [EXAMPLE, PLANNER, POLICY, *sorted((ROOT / "src/mbf_method/src/mbf_method").rglob("*.py"))]


@pytest.mark.parametrize("module", MODULES, ids=lambda path: path.name)
def test_a_module_runs_in_python_3_8_without_ros(module: Path) -> None:
    tree = ast.parse(module.read_text(), feature_version=(3, 8))
    names = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names |= {item.name for node in ast.walk(tree) if isinstance(node, ast.Import) for item in node.names}
    foreign = {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names)
    of_module = {"coal", "pinocchio"} if module == PLANNER else set()
    of_module |= {"new_method"} if module.stem.endswith("_test") else set()
    assert foreign <= {"mbf_method", "msgpack", "numpy", "websockets"} | of_module
    decorators = [
        decorator
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        for decorator in node.decorator_list
        if isinstance(decorator, ast.Call)
    ]
    assert all(keyword.arg == "frozen" for call in decorators for keyword in call.keywords), "slots came in 3.10"


@pytest.mark.parametrize("example", [EXAMPLE, PLANNER, POLICY], ids=lambda path: path.stem)
def test_the_page_shows_the_example(example: Path) -> None:
    code = example.read_text().split("\n", 1)[1]  # without the licence
    assert f"```python\n{code}```" in (ROOT / "docs/own_method.md").read_text()


def test_the_example_grasps_a_box_across_its_narrow_side(box_request: GraspRequest) -> None:
    method = runpy.run_path(str(EXAMPLE))["narrow_grasps"]
    grasps = checked_grasps(unpack(pack(method(box_request))), box_request, 1000)
    best = int(np.argmax(grasps.scores))
    assert grasps.widths[best] == pytest.approx(0.04)
    assert grasps.poses[best, :3, 0] == pytest.approx([1.0, 0.0, 0.0])
    assert grasps.poses[best, :3, 3] == pytest.approx([0.0, 0.0, 0.085])
