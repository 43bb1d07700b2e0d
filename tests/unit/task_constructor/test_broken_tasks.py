# SPDX-License-Identifier: BSD-3-Clause
"""Broken tasks, one fault each, in a folder named after it: the messages are exactly those in its expected.txt.

Each message says where the fault is, what was found, what is allowed, and what was meant.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from task_folders import GOOD_TASK, World

FOLDERS = sorted(path for path in (Path(__file__).parent / "broken_tasks").iterdir() if path.is_dir())
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


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_broken_task_gives_exactly_the_expected_messages(world: World, folder: Path) -> None:
    faults = world.faults((folder / "task.yaml").read_text(), "task.yaml")
    expected = (folder / "expected.txt").read_text().splitlines()
    assert [fault.replace(str(world.folder), "") for fault in faults] == expected
    assert len(expected) == 1 or folder.name in FOLLOWED_UP


def test_there_are_a_hundred_of_them_and_more() -> None:
    assert len(FOLDERS) >= 100


FOLLOWED_UP = {
    "yaml_key_twice_and_other_faults",
    "own_outcomes_do_not_match_transitions",
    "outcome_misspelt_in_transitions_and_missing",
}
"""Several slips, or one with two true statements: a name that is unknown, and one that is missing."""


def test_all_faults_are_reported_at_once_in_the_order_of_the_file(world: World) -> None:
    text = GOOD_TASK.replace("source: plan", "source: pan").replace("{success: done, fail: gave_up}", "{success: dne}")
    faults = world.faults(text.replace("name: tiny", "name: my task"))
    assert len(faults) == 4
    lines = [int(fault.split(":")[1]) for fault in faults]
    assert lines == sorted(lines)


def test_a_missing_key_is_reported_beside_wrong_transitions_and_a_repeated_label_beside_what_is_wrong_below_it(
    world: World,
) -> None:
    states = "{target: home, source: plan, transitions: {success: dne, fail: gave_up}}"
    text = f"name: t\nsource: state_machine\noutcomes: [done, gave_up]\nstates:\n  - A: {states}\n"
    faults = world.faults(text + "  - B: {source: use_arm, transitions: {success: done, fail: gave_up}}\n")
    assert len(faults) == 3 and "target 'dne' is unknown" in faults[0] and "'B' is never reached" in faults[1]
    assert "needs the userdata key" in faults[2]
    faults = world.faults(text.replace("dne", "done") + "  - A: {source: plan, spede: 1.0}\n")
    assert len(faults) == 3 and "'target' is missing" in faults[0] and "is given twice" in faults[1]
    assert "did you mean 'speed'?" in faults[2]


def test_faults_of_values_links_ways_outcomes_and_userdata_are_reported_together(world: World) -> None:
    faults = world.faults("""name: t
source: state_machine
outcomes: [done, gave_up, never]
states:
  - A: {source: plan, target: home, speed: quick, transitions: {success: Bb, fail: gave_up}}
  - Bbb: {source: use_arm, transitions: {success: done, fail: gave_up}}
  - C: {source: plan, target: home, transitions: {success: C, fail: C}}
""")
    expected = (
        ":3:11: the outcome 'never' is never produced",
        ":5:44: state 'A' (plan): option 'speed'",
        ":5:74: state 'A': transition target 'Bb'",
        ":6:5: state 'Bbb' needs the userdata key",
        ":7:5: state 'C' is never reached",
    )
    assert len(faults) == len(expected)
    assert all(wanted in fault for fault, wanted in zip(faults, expected, strict=True)), faults


def test_a_template_of_the_original_framework_is_refused_with_what_is_written_for_its_names(tmp_path: Path) -> None:
    (tmp_path / "mine.template").write_text("""{% for state_to_import in state_machine.states_source %}
{% endfor %}
class {{ state_machine.type }}(smach.StateMachine):
    def __init__(self, outcomes={{ state_machine.parameters.outcomes }}):
        {% for name, state in state_machine.components.items() %}{% endfor %}
""")
    faults = World(tmp_path, tmp_path).faults(GOOD_TASK.replace("source: state_machine", "source: mine"))
    assert len(faults) == 1
    for said in (
        "t.yaml:2:9: 'tiny': the template 'mine' cannot be used",
        "mine.template:1: state_machine.states_source",
        "mine.template:4: state_machine.parameters is now fields of state_machine",
        "mine.template:5: state_machine.components is now state_machine.states, which children.add writes",
    ):
        assert said in faults[0]


SMACH_STATE = """\
import smach


class Unlock(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=["opened", "stuck"], input_keys=["door"], output_keys=["angle"])

    def execute(self, userdata):
        door = userdata.door
        userdata.angle = 1.0 if door else 0.0
        return "opened"
"""


def test_a_state_that_declares_its_keys_itself_is_taken_at_its_word(tmp_path: Path) -> None:
    text = """\
name: tiny
source: framework_state_machine
outcomes: [done, gave_up]
states:
  - A:
      source: unlock
      remapping: {door: selected_pose, angle: selected_plan}
      transitions: {opened: done, stuck: gave_up}
"""
    world = World(tmp_path, states={"unlock": SMACH_STATE})
    assert world.faults(text) == []
    misspelt = world.faults(text.replace("opened:", "success:"))
    assert "outcome 'success' is unknown; allowed: opened, stuck" in misspelt[1]
    other = World(tmp_path, states={"unlock": SMACH_STATE.replace("door = userdata.door", "door = userdata.gate")})
    assert other.faults(text)[0].endswith("but its input keys are: door; add it to input_keys in unlock.py")


def test_a_key_that_a_state_asks_for_before_it_reads_it_may_be_left_out(tmp_path: Path) -> None:
    state = """\
from modular_framework_core.state_api.framework_state import FrameworkState


class Search(FrameworkState):
    def __init__(self, outcomes=("success", "fail"), input_keys=("hint",)):
        super().__init__(outcomes, input_keys)

    def execute(self, userdata):
        return self.succeed() if "hint" in userdata and userdata.hint else self.fail("no hint")
"""
    world = World(tmp_path, states={"search": state})
    assert world.faults(GOOD_TASK.replace("source: move", "source: search\n      input_keys: []")) == []


def test_the_good_tasks_have_no_fault(world: World) -> None:
    shared = NESTED.replace(
        "outcomes: [done, gave_up]\n      states",
        "outcomes: [done, gave_up]\n      userdata: self.userdata\n      states",
    )
    assert [world.faults(text) for text in (GOOD_TASK, CONCURRENT, shared)] == [[], [], []]
