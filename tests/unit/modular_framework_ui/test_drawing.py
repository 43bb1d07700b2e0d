# SPDX-License-Identifier: BSD-3-Clause
"""The drawing of a running machine has the ids with which the page finds states and transitions."""

from __future__ import annotations

from xml.etree import ElementTree

from modular_framework_core.task_constructor import machine_graph
from modular_framework_core.task_constructor.machine_graph import MachineFrame, StateBox, Transition

SVG = "{http://www.w3.org/2000/svg}"
INNER = MachineFrame(
    label="Hold",
    outcomes=("held", "failed"),
    children=(StateBox(label="Close"), StateBox(label="Say: <b>hi</b>")),
    initial=("Close",),
    transitions=(
        Transition(start="Close", outcome="success", target="Say: <b>hi</b>"),
        Transition(start="Say: <b>hi</b>", outcome="success", target="held"),
    ),
)
TASK = MachineFrame(
    label="pick",
    outcomes=("done", "gave_up"),
    children=(StateBox(label="Look"), INNER),
    initial=("Look",),
    transitions=(
        Transition(start="Look", outcome="success", target="Hold"),
        Transition(start="Hold", outcome="held", target="done"),
    ),
)


def groups(machine: MachineFrame) -> dict[str, ElementTree.Element]:
    svg = machine_graph.render(machine_graph.draw(machine).source, "svg")
    return {group.get("id", ""): group for group in ElementTree.fromstring(svg).iter(f"{SVG}g")}


def test_states_machines_and_arrows_have_their_paths_as_ids() -> None:
    found = groups(TASK)
    kinds = {
        name: group.get("class") for name, group in found.items() if group.get("class") in ("node", "cluster", "edge")
    }
    assert {name for name, kind in kinds.items() if kind == "cluster"} == {"pick", "pick/Hold"}
    states = {name for name, kind in kinds.items() if kind == "node" and "|" not in name}
    assert {"pick/Look", "pick/Hold/Close", "pick/Hold/Say: <b>hi</b>"} <= states
    assert kinds["pick/Look success"] == kinds["pick/Hold held"] == kinds["pick/Hold/Close success"] == "edge"


def test_a_label_with_a_colon_and_markup_is_one_box_with_its_own_text() -> None:
    found = groups(INNER)
    boxes = [name for name, group in found.items() if group.get("class") == "node" and "|" not in name]
    assert sorted(boxes) == ["Hold/Close", "Hold/Say: <b>hi</b>"]
    assert "".join(found["Hold/Say: <b>hi</b>"].itertext()).strip().endswith("Say: <b>hi</b>")
