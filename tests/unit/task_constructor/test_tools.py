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
    done = subprocess.run(
        ["dot", "-Tjson"], input=task_graph.draw(task).source, capture_output=True, text=True, check=True, timeout=60
    )
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


def test_a_drawing_that_cannot_be_written_is_reported_with_its_path(world: World, tmp_path: Path) -> None:
    with pytest.raises(
        task_graph.GraphError, match=r"absent/out\.svg cannot be written.*name a file in an existing folder"
    ):
        task_graph.write(world.build(GOOD_TASK), tmp_path / "absent" / "out.svg")


def test_arrows_are_the_transitions_of_the_task(world: World) -> None:
    assert arrows(graph_of(world.build(GOOD_TASK))) == {
        ("tiny|start", "", "tiny/A"),
        ("tiny/A", "success", "tiny/B"),
        ("tiny/A", "fail", "tiny|gave_up"),
        ("tiny/B", "success", "tiny|done"),
        ("tiny/B", "fail", "tiny|gave_up"),
    }


def test_the_drawing_begins_with_the_initial_state_and_the_schema_takes_all_keys(
    world: World, validator: jsonschema.Draft7Validator
) -> None:
    text = (
        GOOD_TASK.replace("states:", "initial_state: B\nstates:")
        .replace("success: done", "success: A")
        .replace("success: B", "success: done")
    )
    assert ("tiny|start", "", "tiny/B") in arrows(graph_of(world.build(text)))
    task = """name: t
source: framework_state_machine
outcomes: [done, gave_up]
initial_state: B
anchors: {slow: &slow {planning_time: 1.0}}
external_names: {plan: [homing]}
states:
  - A: {source: move, plan_name: homing, remapping: {arm_commander: arm}, transitions: {success: done, fail: gave_up}}
  - B: {source: set_planner, <<: *slow, group: hand, transitions: {success: A, fail: gave_up}}
  - C:
      source: call_service
      service_name: s
      request: {a: userdata.b}
      outcome_field: code
      outcome_values: {found: 0, fail: [1, 2]}
      keep: {c: d.e}
      outcomes: [found, fail]
"""
    assert list(validator.iter_errors(yaml.safe_load(task))) == []
    assert not validator.is_valid(yaml.safe_load(task.replace("remapping", "remaping")))


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
    assert "plan_name: a text, default ''\n      Name of the stored plan; empty for an anonymous plan." in page
    assert "Outcomes: success, fail (by default)" in page and "Io keys: arm_commander (by default)" in page


def explanation(capsys: pytest.CaptureFixture[str], name: str, templates: str = str(TEMPLATES)) -> str:
    assert main(["--explain", name, "", str(STATES), templates]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(("name", "meant"), [("plann", "plan"), ("state_machin", "state_machine")])
def test_an_unknown_name_is_answered_by_all_names_and_the_nearest(
    capsys: pytest.CaptureFixture[str], name: str, meant: str
) -> None:
    assert main(["--explain", name, "", str(STATES), str(TEMPLATES)]) == 1
    message = capsys.readouterr().err
    assert f"'{name}' is neither a state nor a template; states: allow_manipulator_collisions, " in message
    assert "templates: concurrent_state_machine, framework_state_machine, " in message
    assert message.endswith(f"state_machine; did you mean '{meant}'?\n")


def test_a_template_is_explained_by_its_keys_and_userdata(capsys: pytest.CaptureFixture[str]) -> None:
    page = explanation(capsys, "framework_state_machine")
    assert "Runs one state after the other, with the userdata that the framework's states expect." in page
    assert "  node_name: a name, optional, in a task only\n      Name of the ROS node" in page
    assert "  outcomes: a list of names, required in a task, optional in a nested machine\n" in page
    assert "  userdata: self.userdata, optional, in a nested machine only\n" in page
    assert "  states: a list of '- Label: {source: ...}', required\n" in page
    assert "Userdata provided: arm_commander, " in page and "default_outcome" not in page
    assert "Userdata provided: none" in explanation(capsys, "state_machine")
    page = explanation(capsys, "concurrent_state_machine")
    assert "  outcome_map: a mapping {outcome: {label: outcome of that state}}, optional\n" in page


def test_a_template_of_ones_own_is_explained_with_the_keys_it_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "timed.template").write_text(
        "class {{ state_machine.type }}(smach.StateMachine):\n"
        '    """Ends\n    in time."""\n    limit = {{ options.time_limit }}\n'
    )
    (tmp_path / "bare.template").write_text("class {{ state_machine.type }}(smach.StateMachine): pass\n")
    page = explanation(capsys, "timed", f"{tmp_path}:{TEMPLATES}")
    assert f"timed: template, {tmp_path}/timed.template\n\nEnds\nin time.\n\n" in page
    assert "  time_limit: any value, optional\n      Option of this template, available in the template as " in page
    assert "input_keys" not in page and "Userdata provided: unknown" in page
    assert "(its class has no docstring)" in explanation(capsys, "bare", str(tmp_path))


def test_what_the_schema_allows_in_a_header_is_what_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    templates = TemplateCatalogue([TEMPLATES])
    schema = task_schema(StateCatalogue([STATES]), templates)
    for root, name in zip(schema["oneOf"], templates.names(), strict=True):
        nested = schema["definitions"][f"machine_{name}"]
        explained = [
            line.split(":")[0].strip()
            for line in explanation(capsys, name).splitlines()
            if line.startswith("  ") and line[2] != " " and ": " in line
        ]
        assert set(explained) == set(root["properties"]) | set(nested["properties"])


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft7Validator:
    schema = task_schema(StateCatalogue([STATES]), TemplateCatalogue([TEMPLATES]))
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


@pytest.mark.parametrize("text", [JUST_PLANNING, WITH_PARAMS, MOCK_TRAJECTORY, *(path.read_text() for path in SHIPPED)])
def test_tasks_that_are_in_order_fit_the_schema(validator: jsonschema.Draft7Validator, text: str) -> None:
    assert list(validator.iter_errors(yaml.safe_load(text))) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("source: state_plan", "source: state_pln"),
        ("target_state_type: joint_state", "target_state_type: joint_sate"),
        ("plan_name: current_to_stability", "plan_nmae: current_to_stability"),
        ("plan_name: current_to_stability", "plan_name: 5"),
        ("outcomes: [sm_successful, sm_failed]", "outcomes: sm_successful"),
        ("source: framework_state_machine", "source: framework_machine"),
        ("node_name:", "nodename:"),
    ],
)
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
