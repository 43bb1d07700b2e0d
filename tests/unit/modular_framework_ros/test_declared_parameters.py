# SPDX-License-Identifier: BSD-3-Clause
"""Nodes read their parameters as their declaration says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader, read_declaration

DECLARED = """
parameters:
  ~rate: {type: float, default: 10, above: 0, at_most: 100, doc: "Rate [Hz]."}
  ~mode: {type: str, default: fast, choices: [fast, slow], doc: "Pace."}
  ~limit: {type: float, doc: "Limit [m]; none if it is not set."}
  ~ids: {type: list, items: int, at_least: 0, default: [1], doc: "Servos."}
  ~port: {type: str, required_with: ~ids, default: "", doc: "Port of the servos."}
  group: {type: str, required: true, doc: "Planning group."}
"""


def reader(folder: Path, **values: Any) -> ParameterReader:
    file = folder / "node.yaml"
    file.write_text(DECLARED)
    named = {("" if name == "group" else "~") + name: value for name, value in values.items()}
    return ParameterReader(read_declaration(file), named.get, lambda name: name.replace("~", "/node/"))


def test_a_parameter_that_is_not_set_has_its_default(tmp_path: Path) -> None:
    rate, mode, limit = reader(tmp_path).values("~rate", "~mode", "~limit")
    assert (rate, mode, limit) == (10.0, "fast", None) and isinstance(rate, float)


def test_a_whole_number_is_read_as_the_float_that_is_declared(tmp_path: Path) -> None:
    rate = reader(tmp_path, rate=5).value("~rate")
    assert rate == 5.0 and isinstance(rate, float)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("rate", 0, "parameter '/node/rate' is 0; allowed: a number, above 0 and at most 100 (Rate [Hz])"),
        ("rate", "10", "parameter '/node/rate' is '10'; allowed: a number, above 0 and at most 100"),
        ("rate", True, "parameter '/node/rate' is True; allowed: a number"),
        ("limit", float("nan"), "parameter '/node/limit' is nan; allowed: a number (Limit [m]"),
        ("ids", [1, -1], "parameter '/node/ids' is [1, -1]; allowed: a list, each a whole number, at least 0 (Servos)"),
        ("ids", [True], "parameter '/node/ids' is [True]; allowed: a list"),
        ("mode", "idle", "parameter '/node/mode' is 'idle'; allowed: fast, slow (Pace)"),
        ("group", "", "parameter 'group' is ''; allowed: a text that is not empty (Planning group)"),
    ],
)
def test_a_wrong_value_is_refused_with_what_is_allowed(tmp_path: Path, name: str, value: Any, text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        reader(tmp_path, **{name: value}).value("group" if name == "group" else f"~{name}")
    assert text in str(caught.value)


def test_a_parameter_is_required_with_another(tmp_path: Path) -> None:
    assert reader(tmp_path).value("~port") == ""
    with pytest.raises(ParameterError) as caught:
        reader(tmp_path, ids=[2]).value("~port")
    assert "parameter '/node/port' is ''; allowed: a text that is not empty" in str(caught.value)


def test_all_faults_are_named_at_once(tmp_path: Path) -> None:
    with pytest.raises(ParameterError) as caught:
        reader(tmp_path, rate=-1, mode="idle").all()
    for text in ("'/node/rate' is -1", "'/node/mode' is 'idle'", "parameter 'group' is not set; allowed: a text"):
        assert text in str(caught.value)


SOURCES = Path(__file__).resolve().parents[3] / "src"


@pytest.mark.parametrize("file", sorted(SOURCES.glob("**/parameters/*.yaml")), ids=lambda file: file.stem)
def test_every_declared_default_is_allowed_itself(file: Path) -> None:
    declared = read_declaration(file).parameters
    assert declared
    for item in declared.values():
        assert item.default is None or (item.required and item.default == "") or not item.fault(item.default), item
        assert item.doc.endswith("."), f"{item.name} has no sentence of its meaning"


def test_no_node_reads_a_private_parameter_past_its_declaration() -> None:
    found = [
        f"{file}: {line.strip()}"
        for file in SOURCES.glob("**/*.py")
        for line in file.read_text(encoding="utf-8").splitlines()
        if 'get_param("~' in line and 'get_param("~", {})' not in line
    ]
    assert not found
