# SPDX-License-Identifier: BSD-3-Clause
"""Names below a parameter are held against its declaration and the robot's joints, links and groups."""

from __future__ import annotations

from pathlib import Path

import pytest

from modular_framework_ros.declared_trees import tree_fault
from modular_framework_ros.parameter_declarations import NodeDeclaration, read_declaration

DECLARATION = """
parameters:
  factor: {type: float, above: 0, doc: "A factor."}
  "limits/{joint}/speed": {type: float, above: 0, doc: "A speed."}
  "limits/{joint}/soft": {type: bool, doc: "Whether it is soft."}
  "padding/{link}": {type: float, doc: "A length."}
"""
ROBOT = {"joint": ("shoulder", "elbow", "base/x")}


@pytest.fixture
def declaration(tmp_path: Path) -> NodeDeclaration:
    (tmp_path / "tree.yaml").write_text(DECLARATION)
    return read_declaration(tmp_path / "tree.yaml")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("factor", 0.5, ""),
        ("limits/elbow/speed", 1.0, ""),
        ("limits/base/x/speed", 1.0, ""),
        ("padding/any_link_of_an_unknown_robot", 0.1, ""),
        ("factr", 0.5, "names no parameter: 'factr'; allowed: factor, limits, padding; did you mean 'factor'?"),
        ("limits/elbo/speed", 1.0, "names no joint: 'elbo'; allowed: shoulder, elbow, base/x; did you mean 'elbow'?"),
        ("limits/elbow/sped", 1.0, "names no parameter: 'sped'; allowed: speed, soft; did you mean 'speed'?"),
        ("limits/elbow/speed/fast", 1.0, "names no parameter: 'fast'; there is none"),
        ("limits/elbow", 1.0, "is 1.0; allowed: speed, soft below it"),
        ("limits/elbow/speed", 0, "is 0; allowed: a number, above 0 (A speed)"),
    ],
)
def test_a_name_is_refused_with_the_names_at_its_place(
    name: str, value: object, words: str, declaration: NodeDeclaration
) -> None:
    assert tree_fault(name, value, declaration, ROBOT) == words
