# SPDX-License-Identifier: BSD-3-Clause
"""Broken tasks, one fault each: the message says where, what was found, what is allowed, and what was meant."""
from __future__ import annotations

import pytest
from task_folders import GOOD_TASK, World

STATES = "broken_file, move, plan, remember, use_arm, wrong_class"
TEMPLATES = "concurrent_state_machine, framework_state_machine, state_machine"
ROOT_KEYS = "name, node_name, source, outcomes, params, states"
CONCURRENT = """\
name: tiny
source: concurrent_state_machine
outcomes: [good, bad]
default_outcome: bad
outcome_map: {good: {A: success, B: success}}
states:
  - A: {source: move}
  - B: {source: move}
"""
NESTED = """\
name: tiny
source: framework_state_machine
outcomes: [done, gave_up]
states:
  - Inner:
      source: state_machine
      outcomes: [done, gave_up]
      states:
        - A:
            source: use_arm
            transitions: {success: done, fail: gave_up}
"""


def changed(old: str, new: str, text: str = GOOD_TASK) -> str:
    assert old in text
    return text.replace(old, new, 1)


CASES = {
    "unknown_source": (
        changed("source: plan", "source: paln"),
        f"t.yaml:6:15: state 'A': source 'paln' is unknown; allowed: {STATES}; did you mean 'plan'?",
    ),
    "unknown_template": (
        changed("source: state_machine", "source: sate_machine"),
        f"t.yaml:2:9: template 'sate_machine' is unknown; allowed: {TEMPLATES}; did you mean 'state_machine'?",
    ),
    "source_missing": (changed("      source: move\n", ""), "t.yaml:10:7: state 'B' has no 'source'"),
    "unknown_option": (
        changed("target: home", "target: home\n      plan_nmae: x"),
        "t.yaml:8:7: state 'A' (plan): option 'plan_nmae' is unknown; allowed: target, plan_name, speed, outcomes, "
        "input_keys, output_keys, io_keys; did you mean 'plan_name'?",
    ),
    "required_option_missing": (
        changed("      target: home\n", ""),
        "t.yaml:5:5: state 'A' (plan): option 'target' is missing; it has no default",
    ),
    "outcome_without_transition": (
        changed("{success: B, fail: gave_up}", "{success: B}"),
        "t.yaml:5:5: state 'A': no transition for 'fail'; add it to transitions, leading to one of: "
        "A, B, done, gave_up",
    ),
    "transition_to_unknown_target": (
        changed("{success: B, fail: gave_up}", "{success: B, fail: give_up}"),
        "t.yaml:8:39: state 'A': transition target 'give_up' is unknown; allowed: A, B, done, gave_up; "
        "did you mean 'gave_up'?",
    ),
    "transition_from_unknown_outcome": (
        changed("{success: B, fail: gave_up}", "{success: B, fail: gave_up, failed: gave_up}"),
        "t.yaml:8:48: state 'A': outcome 'failed' is unknown; allowed: success, fail; did you mean 'fail'?",
    ),
    "own_outcomes_do_not_match_transitions": (
        changed("target: home", "target: home\n      outcomes: [success, failed]"),
        "t.yaml:5:5: state 'A': no transition for 'failed'; add it to transitions, leading to one of: "
        "A, B, done, gave_up",
    ),
    "transitions_are_no_mapping": (
        changed("{success: B, fail: gave_up}", "B"),
        "t.yaml:8:20: state 'A': transitions must be a mapping such as {success: NextState}, found the text 'B'",
    ),
    "transition_target_is_a_list": (
        changed("fail: gave_up}\n  - B", "fail: [gave_up]}\n  - B"),
        "t.yaml:8:39: state 'A': transitions: the value of 'fail' must be a name, found a list",
    ),
    "params_key_missing": (
        changed("states:", "params: {place: home}\nstates:").replace("target: home", "target: params.plaec"),
        "t.yaml:8:15: 'params.plaec' refers to nothing: no params around it has the key 'plaec'; allowed: place; "
        "did you mean 'place'?",
    ),
    "params_key_missing_in_a_list": (
        changed("target: home", "target: [params.x]"),
        "t.yaml:7:16: 'params.x' refers to nothing: no params around it has the key 'x'; none is allowed here",
    ),
    "params_are_no_mapping": (
        changed("states:", "params: [a]\nstates:"),
        "t.yaml:4:9: params must be a mapping such as {outcomes: [success, fail]}, found a list",
    ),
    "params_of_a_state_without_use": (
        changed("target: home", "target: home\n      params: {sped: 1.0}"),
        "t.yaml:8:16: state 'A' (plan): params: option 'sped' is unknown; allowed: target, plan_name, speed, "
        "outcomes, input_keys, output_keys, io_keys; did you mean 'speed'?",
    ),
    "duplicate_label": (
        changed("success: B, fail", "success: A, fail").replace("- B:", "- A:"),
        "t.yaml:9:5: the label 'A' is given twice; first in line 5",
    ),
    "label_is_an_outcome": (
        changed("- B:", "- done:").replace("{success: B,", "{success: done,"),
        "t.yaml:9:5: the label 'done' is also an outcome of the machine; rename one of them",
    ),
    "label_with_a_space": (
        changed("- B:", "- B c:").replace("{success: B,", "{success: B c,"),
        "t.yaml:9:5: the label 'B c' must be letters, digits, _ and -, and start with a letter",
    ),
    "two_labels_in_one_entry": (
        changed("  - B:", "    B:"),
        "t.yaml:5:5: one entry of states has the labels A, B; each state needs its own '-', and its options are "
        "indented below the label",
    ),
    "options_at_the_depth_of_the_label": (
        changed("  - B:\n      source: move\n      transitions", "  - B:\n    source: move\n    transitions"),
        "t.yaml:9:5: one entry of states has the labels B, source, transitions; each state needs its own '-', and "
        "its options are indented below the label",
    ),
    "state_never_reached": (
        changed("{success: B, fail: gave_up}", "{success: done, fail: gave_up}"),
        "t.yaml:9:5: state 'B' is never reached: no transition leads to it",
    ),
    "yaml_syntax": (
        changed("{success: B, fail: gave_up}", "{success: B, fail: gave_up"),
        "t.yaml:9:6: this is not valid YAML: expected ',' or '}', but got ':' while parsing a flow mapping",
    ),
    "yaml_tab": (
        changed("      source: move", "\tsource: move"),
        "t.yaml:10:1: this is not valid YAML: found character '\\t' that cannot start any token while scanning for "
        "the next token",
    ),
    "yaml_key_twice": (
        changed("target: home", "target: home\n      target: work"),
        "t.yaml:8:7: the key 'target' is given twice; first in line 7",
    ),
    "yaml_tag": (
        changed("target: home", "target: !!python/object/apply:os.system [ls]"),
        "t.yaml:7:15: the tag tag:yaml.org,2002:python/object/apply:os.system cannot be used here",
    ),
    "yaml_date": (
        changed("target: home", "target: 2020-01-31"),
        "t.yaml:7:15: '2020-01-31' is read as a date; put it in quotes to make it text",
    ),
    "yaml_number_as_key": (
        changed("{success: B, fail: gave_up}", "{success: B, fail: gave_up, 1: B}"),
        "t.yaml:8:48: a key must be text, found the number 1; put it in quotes",
    ),
    "yaml_endless": (
        changed("target: home", "target: &x [*x]"),
        "t.yaml:7:15: this value contains itself through an alias",
    ),
    "empty_file": ("", "t.yaml:1:1: the file is empty; a task needs name, source, outcomes and states"),
    "a_list_at_the_top": (
        "- a\n",
        "t.yaml:1:1: a task must be a mapping with allowed: name, node_name, source, outcomes, params, states, "
        "default_outcome, outcome_map, found a list",
    ),
    "name_missing": (changed("name: tiny\n", ""), "t.yaml:1:1: the task has no 'name'"),
    "name_misspelt": (
        changed("name: tiny\n", "nam: tiny\n"),
        f"t.yaml:1:1: 'task' (template state_machine): key 'nam' is unknown; allowed: {ROOT_KEYS}; "
        "did you mean 'name'?",
    ),
    "name_is_no_identifier": (
        changed("name: tiny", "name: my task"),
        "t.yaml:1:7: name 'my task' must be letters, digits and underscores, and start with a letter",
    ),
    "name_would_leave_the_folder": (
        changed("name: tiny", "name: ../tiny"),
        "t.yaml:1:7: name '../tiny' must be letters, digits and underscores, and start with a letter",
    ),
    "node_name_with_a_space": (
        changed("outcomes", "node_name: my node\noutcomes"),
        "t.yaml:3:12: node_name 'my node' must be letters, digits and underscores, and start with a letter",
    ),
    "outcomes_are_a_text": (
        changed("[done, gave_up]", "done"),
        "t.yaml:3:11: outcomes must be a list such as [success, fail], found the text 'done'",
    ),
    "outcomes_are_empty": (
        changed("[done, gave_up]", "[]"),
        "t.yaml:3:11: outcomes is an empty list; it needs at least one name",
    ),
    "outcome_twice": (changed("[done, gave_up]", "[done, gave_up, done]"), "t.yaml:3:27: outcomes has 'done' twice"),
    "outcome_is_a_truth_value": (
        changed("[done, gave_up]", "[done, gave_up, true]"),
        "t.yaml:3:27: each of outcomes must be a text, found the truth value true",
    ),
    "states_are_missing": ("name: t\nsource: state_machine\noutcomes: [a]\n", "t.yaml:1:1: the task has no 'states'"),
    "states_are_empty": (
        "name: t\nsource: state_machine\noutcomes: [a]\nstates: []\n",
        "t.yaml:4:9: states must be a list of '- Label: {source: ...}', found an empty list",
    ),
    "states_are_a_mapping": (
        "name: t\nsource: state_machine\noutcomes: [a]\nstates: {A: {source: move}}\n",
        "t.yaml:4:9: states must be a list of '- Label: {source: ...}', found a mapping",
    ),
    "a_state_without_content": (
        changed("  - B:\n      source: move\n      transitions: {success: done, fail: gave_up}\n", "  - B:\n"),
        "t.yaml:9:5: state 'B' must be a mapping with 'source', found nothing",
    ),
    "a_template_without_states": (
        changed("source: move", "source: state_machine"),
        "t.yaml:10:15: 'B' uses the template 'state_machine' but has no 'states'",
    ),
    "states_below_a_state": (
        changed("source: move", "source: move\n      states: [{C: {source: move}}]"),
        f"t.yaml:10:15: 'B' contains states, but its source 'move' is a state; allowed: {TEMPLATES}",
    ),
    "a_state_file_that_is_no_python": (
        changed("source: move", "source: broken_file"),
        "broken_file.py cannot be read as Python: invalid syntax",
    ),
    "a_state_file_with_another_class": (
        changed("source: move", "source: wrong_class"),
        "wrong_class.py must define the class WrongClass (the file name in camel case); it defines: Wrongclass",
    ),
    "unknown_header_key": (
        changed("outcomes:", "outcome: [a]\noutcomes:"),
        f"t.yaml:3:1: 'tiny' (template state_machine): key 'outcome' is unknown; allowed: {ROOT_KEYS}; "
        "did you mean 'outcomes'?",
    ),
    "outcome_map_of_a_sequential_machine": (
        changed("states:", "outcome_map: {}\nstates:"),
        f"t.yaml:4:1: 'tiny' (template state_machine): key 'outcome_map' is unknown; allowed: {ROOT_KEYS}; "
        "did you mean 'outcomes'?",
    ),
    "default_outcome_is_no_outcome": (
        changed("default_outcome: bad", "default_outcome: fail", CONCURRENT),
        "t.yaml:4:18: default_outcome 'fail' is unknown; allowed: good, bad",
    ),
    "outcome_map_gives_an_unknown_outcome": (
        changed("{good: {A", "{god: {A", CONCURRENT),
        "t.yaml:5:15: outcome_map: outcome 'god' is unknown; allowed: good, bad; did you mean 'good'?",
    ),
    "outcome_map_names_an_unknown_state": (
        changed("B: success}", "C: success}", CONCURRENT),
        "t.yaml:5:34: outcome_map: state 'C' is unknown; allowed: A, B",
    ),
    "outcome_map_names_an_unknown_outcome_of_a_state": (
        changed("A: success", "A: sucess", CONCURRENT),
        "t.yaml:5:25: outcome_map: outcome of 'A' 'sucess' is unknown; allowed: success, fail; "
        "did you mean 'success'?",
    ),
    "transitions_in_a_concurrent_machine": (
        changed("B: {source: move}", "B: {source: move, transitions: {success: A}}", CONCURRENT),
        "t.yaml:8:37: state 'B' has transitions, but it runs in a concurrent machine, where states end together; "
        "remove them and use outcome_map of the machine",
    ),
    "userdata_is_code": (
        changed("outcomes: [done, gave_up]\n      states", "outcomes: [done, gave_up]\n      userdata: self.evil()\n"
                "      states", NESTED),
        "t.yaml:8:17: userdata can only be self.userdata, found the text 'self.evil()'",
    ),
    "userdata_not_shared": (
        NESTED,
        "t.yaml:9:11: state 'A' needs the userdata key 'arm_commander', which the machine 'Inner' does not have; "
        "none is allowed here; 'userdata: self.userdata' in the header of 'Inner' shares the keys around it",
    ),
    "userdata_of_another_template": (
        changed("source: move", "source: use_arm"),
        "t.yaml:9:5: state 'B' needs the userdata key 'arm_commander', which the machine 'tiny' does not have; "
        "none is allowed here; the template framework_state_machine provides it",
    ),
    "userdata_keys_are_a_text": (
        changed("target: home", "target: home\n      io_keys: arm"),
        "t.yaml:8:16: state 'A': io_keys must be a list such as [success, fail], found the text 'arm'",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_broken_task_gives_exactly_one_message(world: World, case: str) -> None:
    text, message = CASES[case]
    faults = world.faults(text)
    assert faults, "the fault was not found"
    assert any(message in fault for fault in faults), faults
    assert len(faults) == 1 or case in FOLLOWED_UP, faults


FOLLOWED_UP = {"name_misspelt", "own_outcomes_do_not_match_transitions"}
"""One slip, two true statements: a name that is unknown, and one that is missing."""


def test_all_faults_are_told_at_once_in_the_order_of_the_file(world: World) -> None:
    text = GOOD_TASK.replace("source: plan", "source: pan").replace("{success: done, fail: gave_up}", "{success: dne}")
    faults = world.faults(text.replace("name: tiny", "name: my task"))
    assert len(faults) == 4
    lines = [int(fault.split(":")[1]) for fault in faults]
    assert lines == sorted(lines)


def test_the_good_tasks_have_no_fault(world: World) -> None:
    shared = changed("outcomes: [done, gave_up]\n      states", "outcomes: [done, gave_up]\n      userdata: "
                     "self.userdata\n      states", NESTED)
    assert [world.faults(text) for text in (GOOD_TASK, CONCURRENT, shared)] == [[], [], []]
