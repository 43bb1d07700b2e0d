# SPDX-License-Identifier: BSD-3-Clause
"""Generated modules: they run, say what the task said, and nothing in a value becomes code."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from task_folders import GOOD_TASK, TEMPLATES, World

import smach
from modular_framework_core.task_constructor import loading
from modular_framework_core.task_constructor.generator import GenerationError, default_output_directory, literal
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_runner.record import TaskRecorder
from modular_framework_core.task_runner.task_runner import TaskRun

HEADER = "name: t\nsource: state_machine\noutcomes: [success, fail]\nstates:\n"


def machine(world: World, text: str) -> Any:
    module = loading.load_module(world.write(text))
    return loading.machine_factory(module)()


def single(value: str) -> str:
    return HEADER + f"  - A: {{source: remember, v: {value}}}\n"


def test_a_generated_machine_runs_the_states_in_the_order_of_the_task(world: World) -> None:
    made = machine(world, GOOD_TASK)
    assert isinstance(made, smach.StateMachine)
    assert list(made.get_children()) == ["A", "B"]
    assert made.get_registered_outcomes() == ("done", "gave_up")
    assert made.execute() == "done"


def test_a_generated_module_knows_the_line_of_each_state_and_nested_machine(world: World) -> None:
    text = (
        HEADER + "  - A: {source: remember, v: 1, transitions: {success: M, fail: fail}}\n"
        "  - M:\n      source: state_machine\n      transitions: {success: success, fail: fail}\n"
        "      outcomes: [success, fail]\n      states:\n        - B: {source: remember, v: 2}\n"
    )
    script = world.write(text)
    locations = loading.load_module(script).LOCATIONS
    assert {path: location.rpartition(".yaml:")[2].partition(":")[0] for path, location in locations.items()} == {
        "A": "5",
        "M": "7",  # the machine, after its label
        "M/B": "11",
    }


def test_a_failing_state_takes_the_other_way(world: World) -> None:
    assert machine(world, GOOD_TASK.replace("target: home", "target: nowhere")).execute() == "gave_up"


def test_every_template_can_be_the_root(world: World) -> None:
    text = (
        "name: both\nsource: concurrent_state_machine\noutcomes: [good, bad]\ndefault_outcome: bad\n"
        "outcome_map: {good: {A: success, B: success}}\nstates:\n  - A: {source: move}\n  - B: {source: move}\n"
    )
    made = machine(world, text)
    assert isinstance(made, smach.Concurrence)
    assert made.execute() == "good"
    assert '__name__ == "__main__"' in world.generate(text)
    assert '__name__ == "__main__"' in world.generate(GOOD_TASK)


def test_a_framework_machine_fills_its_userdata_after_its_states(world: World) -> None:
    text = world.generate(GOOD_TASK.replace("source: state_machine", "source: framework_state_machine"))
    assert text.index("initialise_userdata(self.userdata)") > text.index("'B'")


def test_the_default_outcome_of_a_concurrent_machine_is_its_negative_one(world: World) -> None:
    text = (
        "name: both\nsource: concurrent_state_machine\noutcomes: [good, bad]\noutcome_map: {good: {A: fail}}\n"
        "states:\n  - A: {source: move}\n"
    )
    assert machine(world, text).execute() == "bad"


def test_nested_machines_of_one_template_get_classes_of_their_own(world: World) -> None:
    inner = (
        "      source: state_machine\n      outcomes: [success, fail]\n"
        "      states: [{S: {source: plan, target: %s}}]\n"
    )
    states = "  - One:\n" + inner % "home" + "      transitions: {success: Plan}\n  - Plan:\n" + inner % "nowhere"
    made = machine(world, HEADER + states)
    first, second = made.get_children().values()
    assert type(first) is not type(second)
    assert (first.get_children()["S"].target, second.get_children()["S"].target) == ("home", "nowhere")
    assert made.execute() == "fail"


def test_equal_names_of_nested_machines_do_not_overwrite_each_other(world: World) -> None:
    inner = (
        "      source: state_machine\n      name: same\n      outcomes: [success, fail]\n"
        "      states: [{S: {source: plan, target: %s}}]\n"
    )
    text = HEADER + "  - One:\n" + inner % "home" + "      transitions: {success: Two}\n  - Two:\n" + inner % "nowhere"
    assert machine(world, text).execute() == "fail"


@pytest.mark.parametrize("template", ["state_machine", "concurrent_state_machine", "framework_state_machine"])
def test_the_keys_of_a_nested_machine_are_handed_to_its_container(world: World, template: str) -> None:
    inner = (
        "A: {source: move}"
        if template.startswith("concurrent")
        else "A: {source: move, transitions: {success: success, fail: fail}}"
    )
    produced = "      outcome_map: {success: {A: success}}\n" if template.startswith("concurrent") else ""
    before = "  - Writes: {source: go, output_keys: [a, b], transitions: {success: M, fail: fail}}\n"
    task = f"{HEADER}{before}  - M:\n      source: {template}\n{produced}      states:\n        - {inner}\n"
    text = world.generate(f"{task}      input_keys: [a, b]\n      output_keys: [c]\n")
    arguments = "            input_keys=['a', 'b'],\n            output_keys=['c'],\n"
    assert f"\n{arguments}        )\n" in text
    assert world.generate(task) == text.replace(arguments, "")


def test_a_remapping_gives_the_names_of_userdata_around_and_initial_state_where_to_begin(world: World) -> None:
    (world.folder / "own_states" / "add_one.py").write_text("""
import smach


class AddOne(smach.State):
    def __init__(self, outcomes=("success", "fail"), input_keys=("number",), output_keys=("sum",)):
        smach.State.__init__(self, outcomes=outcomes, input_keys=input_keys, output_keys=output_keys)

    def execute(self, userdata):
        userdata.sum = userdata.number + 1
        return "success"
""")
    world.states = StateCatalogue([world.folder / "own_states"])
    add = "source: add_one, transitions: {success: %s, fail: fail}, remapping: {number: %s, sum: %s}"
    text = (
        f"{HEADER.replace('states:', 'initial_state: Begin')}states:\n"
        f"  - One: {{{add % ('M', 'start', 'middle')}}}\n  - M:\n      source: state_machine\n"
        "      input_keys: [before]\n      output_keys: [after]\n      remapping: {before: middle, after: end}\n"
        f"      states:\n        - Two: {{{add % ('success', 'before', 'after')}}}\n"
        "  - Begin: {source: go, output_keys: [start], transitions: {success: One, fail: fail}}\n"
    )
    made = machine(world, text)
    made.get_children()["Begin"].execute = lambda userdata: setattr(userdata, "start", 40) or "success"
    assert made.execute() == "success"
    assert (made.userdata.middle, made.userdata.end) == (41, 42)


def test_values_below_anchors_are_written_once_and_merged_where_they_are_referred_to(world: World) -> None:
    task = world.build(
        "anchors:\n  move: &fast {speed: 0.9, plan_name: p}\n"
        + HEADER
        + "  - A: {<<: *fast, source: plan, target: x, plan_name: q}\n"
    )
    assert task.root.states[0].options == {"speed": 0.9, "plan_name": "q", "target": "x"}


def test_a_state_that_cannot_be_made_is_reported_with_its_place_in_the_task(world: World, tmp_path: Path) -> None:
    (tmp_path / "own_states" / "picky.py").write_text(
        "import smach\n\n\nclass Picky(smach.State):\n    def __init__(self, size):\n"
        "        raise ValueError(f'size is {size}, allowed is 0 or more')\n"
    )
    text = (
        f"{HEADER}  - M:\n      source: state_machine\n      states:\n        - A: {{source: move}}\n"
        "        - B: {source: picky, size: -1, transitions: {success: success, fail: fail}}\n"
    )
    world.states = StateCatalogue([tmp_path / "own_states"])
    module = loading.load_module(world.write(text.replace("move}", "move, transitions: {success: B}}")))
    running = TaskRun("t", loading.machine_factory(module), TaskRecorder())
    running.start()
    assert running.wait(30.0)
    assert (
        running.result().error
        == "the state machine could not be made: 't.yaml:9:11': ValueError: size is -1, allowed is 0 or more"
    )


def test_a_nested_machine_shares_the_userdata_object_when_asked(world: World) -> None:
    text = (
        HEADER + "  - In: {source: state_machine, outcomes: [success, fail], userdata: self.userdata, "
        "states: [{S: {source: remember, v: 1}}]}\n"
    )
    made = machine(world, text)
    assert made.get_children()["In"].userdata is made.userdata
    made.execute()
    assert made.userdata.notes == [{"v": 1}]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("self-collision", "self-collision"),
        ("myself/ready", "myself/ready"),
        ("self.userdata", "self.userdata"),
        ('"a \\"quote\\" and \\\\"', 'a "quote" and \\'),
        ("it's", "it's"),
        ('"two\\nlines"', "two\nlines"),
        ('"{{ 1 + 1 }}"', "{{ 1 + 1 }}"),
        ('"{% raw %}"', "{% raw %}"),
        ("yes", "yes"),
        ("true", True),
        ("null", None),
        ("1.5e3", 1500.0),
        (".inf", math.inf),
        ("[1, {a: b}]", [1, {"a": "b"}]),
        ("[]", []),
    ],
)
def test_a_value_arrives_in_the_state_as_it_was_written(world: World, written: str, value: Any) -> None:
    made = machine(world, single(written))
    assert made.get_children()["A"].options == {"v": value}


SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=10)


@given(VALUES)
@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow])
def test_a_literal_evaluates_to_the_value_it_was_made_from(value: Any) -> None:
    assert eval(literal(value), {"__builtins__": {"float": float}}) == value  # noqa: S307


@given(st.text())
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_text_breaks_the_generated_module(world: World, text: str) -> None:
    task = world.build(single("x"))
    task.root.states[0].options["v"] = text  # type: ignore[union-attr]
    from modular_framework_core.task_constructor import generator

    scope: dict[str, Any] = {"__name__": "generated"}
    exec(compile(generator.generate(task, world.template_folders), "t.py", "exec"), scope)
    assert scope["create_state_machine"]().get_children()["A"].options == {"v": text}


def test_an_object_is_no_literal() -> None:
    with pytest.raises(GenerationError, match="object"):
        literal(object())


def test_a_script_name_with_line_breaks_stays_in_its_comment(world: World, tmp_path: Path) -> None:
    from dataclasses import replace

    from modular_framework_core.task_constructor import generator

    task = replace(world.build(GOOD_TASK), script="a\nimport os\n'''\"\"\"")
    assert "\nimport os" not in generator.generate(task, world.template_folders)


def test_the_written_file_is_executable_and_the_folder_holds_nothing_else(world: World) -> None:
    path = world.write(GOOD_TASK)
    assert path.name == "tiny.py"
    assert os.access(path, os.X_OK)
    assert [file.name for file in path.parent.iterdir()] == ["tiny.py"]


def test_files_go_below_ros_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    assert default_output_directory() == tmp_path / "modular_framework" / "state_machines"
    monkeypatch.delenv("ROS_HOME")
    assert default_output_directory() == Path.home() / ".ros" / "modular_framework" / "state_machines"


# ---- templates of the user's own -----------------------------------------------------------------------------------
OWN = """\
class {{ state_machine.type }}(smach.StateMachine):
    greeting = {{ options.greeting | literal }}

    def __init__(self, userdata=None):
        super().__init__(outcomes={{ state_machine.outcomes | literal }})
        with self:
{% for state in state_machine.states %}
            smach.StateMachine.add({{ state.label | literal }}, {{ state.type }}({% for name, value in
              state.options.items() %}{{ name }}={{ value | literal }}, {% endfor %}),
              transitions={{ state.transitions | literal }})
{% endfor %}
"""


def own_world(folder: Path, template: str) -> World:
    templates = folder / "own_templates"
    templates.mkdir()
    (templates / "polite_machine.template").write_text(template)
    return World(folder, templates)


def test_own_templates_take_header_keys_of_their_own(tmp_path: Path) -> None:
    world = own_world(tmp_path, OWN)
    made = machine(world, GOOD_TASK.replace("source: state_machine", "source: polite_machine\ngreeting: hello"))
    assert made.greeting == "hello"
    assert made.execute() == "done"


def test_userdata_keys_are_refused_where_the_template_has_no_use_for_them(tmp_path: Path) -> None:
    (tmp_path / "own.template").write_text(
        "class {{ state_machine.type }}(smach.StateMachine):\n    def __init__(self):\n"
        "        super().__init__(outcomes={{ state_machine.outcomes | literal }})\n"
    )
    faults = World(tmp_path, tmp_path).faults(
        f"{HEADER}  - M:\n      source: own\n      input_keys: [a]\n      states:\n        - A: {{source: move}}\n"
    )
    assert len(faults) == 1 and "'M' (template own): key 'input_keys' is unknown" in faults[0]


def test_a_header_key_an_own_template_needs_is_named_when_it_is_missing(tmp_path: Path) -> None:
    world = own_world(tmp_path, OWN)
    with pytest.raises(GenerationError, match=r"polite_machine.template.*'greeting'"):
        world.generate(GOOD_TASK.replace("source: state_machine", "source: polite_machine"))


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("{% for x in %}", "polite_machine.template:1:"),
        ("class {{ state_machine.typ }}:\n    pass\n", "typ"),
        ("class {{ state_machine.type }}(:\n", "not valid Python"),
    ],
)
def test_a_faulty_template_is_named(tmp_path: Path, template: str, message: str) -> None:
    world = own_world(tmp_path, template)
    with pytest.raises(GenerationError, match="polite_machine") as caught:
        world.generate(GOOD_TASK.replace("source: state_machine", "source: polite_machine"))
    assert message in str(caught.value)


def test_the_template_in_the_readme_works(tmp_path: Path) -> None:
    readme = TEMPLATES.parent / "README.md"
    example = readme.read_text().split("```\n{# userdata: my_key #}")[1].split("```")[0]
    world = own_world(tmp_path, "{# userdata: my_key #}" + example)
    made = machine(world, GOOD_TASK.replace("source: state_machine", "source: polite_machine\nmy_key: [1, 2]"))
    assert made.userdata.my_key == [1, 2]
    assert made.execute() == "done"
