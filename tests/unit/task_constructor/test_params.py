# SPDX-License-Identifier: BSD-3-Clause
"""params: who sees them, what hides what, and where a reference may stand."""

from __future__ import annotations

from typing import Any

from task_folders import World

from modular_framework_core.task_constructor.task_spec import MachineSpec, StateSpec


def states(world: World, text: str) -> dict[str, StateSpec]:
    return {state.label: state for state in world.build(text).root.leaf_states()}


def root(params: str, body: str) -> str:
    return f"name: t\nsource: state_machine\noutcomes: [success, fail]\nparams: {params}\nstates:\n{body}"


def nested(params: str, body: str) -> str:
    return f"""\
  - Outer:
      source: state_machine
      outcomes: [success, fail]
      params: {params}
      states:
{body}"""


def test_a_machines_params_are_seen_by_all_its_descendants(world: World) -> None:
    body = nested(
        "{}",
        "        - Deep:\n            source: concurrent_state_machine\n            "
        "outcomes: [success, fail]\n            outcome_map: {success: {A: success}}\n            states:\n"
        "              - A: {source: plan, target: params.place}\n",
    )
    assert states(world, root("{place: home}", body))["A"].options == {"target": "home"}


def test_inner_params_hide_outer_ones_key_by_key(world: World) -> None:
    body = nested("{place: work}", "        - A: {source: plan, target: params.place, speed: params.speed}\n")
    assert states(world, root("{place: home, speed: 0.1}", body))["A"].options == {"target": "work", "speed": 0.1}


def test_inner_params_are_not_seen_outside(world: World) -> None:
    body = nested("{place: work}", "        - A: {source: plan, target: x}\n") + "      transitions: {success: B}\n"
    faults = world.faults(root("{}", body + "  - B: {source: plan, target: params.place}\n"))
    assert len(faults) == 1 and "'params.place' refers to nothing" in faults[0]


def test_references_stand_in_lists_and_mappings_and_nested_headers_and_transitions(world: World) -> None:
    text = root(
        "{inner: [good, bad], a: good, next: success, key: notes}",
        """\
  - Inner:
      source: concurrent_state_machine
      outcomes: params.inner
      default_outcome: bad
      outcome_map: {good: {A: success}}
      transitions: {good: params.next, bad: fail}
      states:
        - A: {source: remember, value: [1, params.a, {x: params.a}]}
""",
    )
    task = world.build(text)
    inner = task.root.states[0]
    assert isinstance(inner, MachineSpec)
    assert inner.outcomes == ("good", "bad")
    assert inner.transitions == {"good": "success", "bad": "fail"}
    assert states(world, text)["A"].options == {"value": [1, "good", {"x": "good"}]}


def test_the_params_of_a_state_become_its_options_and_its_own_keys_win(world: World) -> None:
    body = "  - A:\n      source: plan\n      params: {target: home, speed: 0.1}\n      speed: 0.9\n"
    assert states(world, root("{}", body))["A"].options == {"target": "home", "speed": 0.9}


def test_the_params_of_a_state_may_refer_to_outer_ones_and_be_referred_to(world: World) -> None:
    body = "  - A:\n      source: plan\n      params: {where: params.place}\n      target: params.where\n"
    assert states(world, root("{place: home}", body))["A"].options == {"target": "home"}


def test_params_do_not_become_options_of_a_machine_or_of_its_children(world: World) -> None:
    text = root("{speed: 0.1}", "  - A: {source: plan, target: home}\n")
    assert states(world, text)["A"].options == {"target": "home"}


def test_a_text_that_only_contains_params_is_a_text(world: World) -> None:
    text = root("{}", "  - A: {source: plan, target: see params.x for more}\n")
    assert states(world, text)["A"].options["target"] == "see params.x for more"


def test_params_may_refer_to_outer_params(world: World) -> None:
    body = nested("{there: params.place}", "        - A: {source: plan, target: params.there}\n")
    assert states(world, root("{place: home}", body))["A"].options == {"target": "home"}


def test_anchors_and_merge_keys_of_yaml_work(world: World) -> None:
    body = (
        "  - A: &a {source: plan, target: home, speed: 0.1, transitions: {success: B}}\n"
        "  - B: {<<: *a, speed: 0.2, transitions: {success: success}}\n"
    )
    found: dict[str, Any] = states(world, root("{}", body))
    assert found["B"].options == {"target": "home", "speed": 0.2}
