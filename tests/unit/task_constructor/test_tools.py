# SPDX-License-Identifier: BSD-3-Clause
"""What the task constructor offers beside generating: drawings, pages about states, a schema for editors, a cache."""
from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest
import yaml
from task_folders import GOOD_TASK, TEMPLATES, World, write_states
from test_guide_tasks import JUST_PLANNING, MOCK_TRAJECTORY, SCRIPTS, STATES, WITH_PARAMS, build

from modular_framework_core.task_constructor import task_graph
from modular_framework_core.task_constructor.json_schema import task_schema
from modular_framework_core.task_constructor.pipeline import check_task, main
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue

SHIPPED = sorted(SCRIPTS.glob("*.yaml"))
SVG = "{http://www.w3.org/2000/svg}"


def graph_of(task: Any) -> dict[str, Any]:
    """Return what Graphviz itself reads in a drawing."""
    done = subprocess.run(["dot", "-Tjson"], input=task_graph.draw(task).source, capture_output=True, text=True,
                          check=True, timeout=60)
    return dict(json.loads(done.stdout))


def arrows(graph: dict[str, Any]) -> set[tuple[str, str, str]]:
    names = [item["name"] for item in graph["objects"]]
    return {(names[edge["tail"]], edge.get("label", ""), names[edge["head"]]) for edge in graph["edges"]}


@pytest.mark.parametrize("script", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_task_is_drawn_with_all_its_states_and_machines(script: Path, tmp_path: Path) -> None:
    task = check_task(script, [STATES], [TEMPLATES])
    target = tmp_path / "out.svg"
    assert main([str(script), str(STATES), str(TEMPLATES), "--graph", str(target)]) == 0
    written = {element.text for element in ElementTree.parse(target).iter(f"{SVG}text")}
    assert {state.label for state in task.root.leaf_states()} <= written
    assert set(task.root.outcomes) <= written
    frames = {item["name"] for item in graph_of(task)["objects"] if item["name"].startswith("cluster_")}
    assert len(frames) == len(list(task.root.machines()))


def test_a_drawing_that_cannot_be_written_is_told_with_its_path(world: World, tmp_path: Path) -> None:
    with pytest.raises(task_graph.GraphError, match=r"absent/out\.svg cannot be written.*name a file in a folder"):
        task_graph.write(world.build(GOOD_TASK), tmp_path / "absent" / "out.svg")


def test_arrows_are_the_transitions_of_the_task(world: World) -> None:
    assert arrows(graph_of(world.build(GOOD_TASK))) == {
        ("tiny|start", "", "tiny/A"), ("tiny/A", "success", "tiny/B"), ("tiny/A", "fail", "tiny|gave_up"),
        ("tiny/B", "success", "tiny|done"), ("tiny/B", "fail", "tiny|gave_up"),
    }


def test_arrows_of_a_nested_concurrent_machine_leave_from_its_outcomes() -> None:
    found = arrows(graph_of(build(MOCK_TRAJECTORY)))
    inner = "mock_trajectory/ConcurrentPlan"
    assert (f"{inner}|success_plans", "", "mock_trajectory/MoveInit") in found
    assert (f"{inner}/PlanInitPose", "success", f"{inner}|success_plans") in found
    assert (f"{inner}|fail_plans", "", "mock_trajectory|sm_failed") in found


def test_an_unknown_format_of_a_drawing_is_refused_with_the_known_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "out.gif"
    assert main([str(SHIPPED[0]), str(STATES), str(TEMPLATES), "--graph", str(target)]) == 1
    assert "the format 'gif' is unknown; allowed suffixes: .svg, .pdf, .png, .dot" in capsys.readouterr().err
    assert not target.exists()


def test_a_state_is_explained_from_its_signature_and_docstring(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--explain", "plan", "", str(STATES), str(TEMPLATES)]) == 0
    page = capsys.readouterr().out
    assert "target_state_type: one of 'pose', 'joint_state', 'pregrasp', 'grasp', 'postgrasp', required" in page
    assert "plan_name: a text, default ''\n      Name to store the plan under" in page
    assert "Outcomes: success, fail (by default)" in page and "Io keys: arm_commander (by default)" in page


def test_an_unknown_state_is_explained_by_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--explain", "plann", "", str(STATES), str(TEMPLATES)]) == 1
    assert "state 'plann' is unknown; allowed: " in (message := capsys.readouterr().err)
    assert "did you mean 'plan'?" in message


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft7Validator:
    schema = task_schema(StateCatalogue([STATES]), TemplateCatalogue([TEMPLATES]))
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


@pytest.mark.parametrize("text", [JUST_PLANNING, WITH_PARAMS, MOCK_TRAJECTORY, *(path.read_text() for path in SHIPPED)])
def test_tasks_that_are_in_order_fit_the_schema(validator: jsonschema.Draft7Validator, text: str) -> None:
    assert list(validator.iter_errors(yaml.safe_load(text))) == []


@pytest.mark.parametrize(("old", "new"), [
    ("source: state_plan", "source: state_pln"),
    ("target_state_type: joint_state", "target_state_type: joint_sate"),
    ("plan_name: current_to_stability", "plan_nmae: current_to_stability"),
    ("plan_name: current_to_stability", "plan_name: 5"),
    ("outcomes: [sm_successful, sm_failed]", "outcomes: sm_successful"),
    ("source: framework_state_machine", "source: framework_machine"),
    ("node_name:", "nodename:"),
])
def test_slips_do_not_fit_the_schema(validator: jsonschema.Draft7Validator, old: str, new: str) -> None:
    assert old in JUST_PLANNING
    assert not validator.is_valid(yaml.safe_load(JUST_PLANNING.replace(old, new)))


def test_the_schema_can_be_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--schema", "", str(STATES), str(TEMPLATES)]) == 0
    assert json.loads(capsys.readouterr().out)["$schema"].startswith("http://json-schema.org/")


def test_a_module_is_written_again_only_when_something_it_is_made_of_has_changed(tmp_path: Path) -> None:
    script, states, output = tmp_path / "t.yaml", write_states(tmp_path), tmp_path / "out"
    script.write_text(GOOD_TASK)

    def run() -> int:
        assert main([str(script), str(states), str(TEMPLATES), str(output)]) == 0
        return (output / "tiny.py").stat().st_ino

    first = run()
    assert run() == first
    (states / "move.py").write_text((states / "move.py").read_text() + "\n# another\n")
    second = run()
    assert second != first
    script.write_text(GOOD_TASK.replace("home", "work"))
    assert run() != second
