# SPDX-License-Identifier: BSD-3-Clause
"""The examples of the original's guide: those that were right work as printed, the others get the correction."""
from __future__ import annotations

from pathlib import Path

import pytest
from task_folders import TEMPLATES

from modular_framework_core.task_constructor import located_yaml
from modular_framework_core.task_constructor.faults import TaskFault
from modular_framework_core.task_constructor.pipeline import check_task
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.task_builder import TaskBuilder
from modular_framework_core.task_constructor.task_spec import TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue

SOURCE = Path(__file__).parents[3] / "src"
STATES = SOURCE / "modular_framework_states" / "src" / "modular_framework_states" / "states"
SCRIPTS = SOURCE / "modular_framework_api" / "task_constructor_scripts"

JUST_PLANNING = """\
name: just_planning
source: framework_state_machine
node_name: just_planning_sm
outcomes: [sm_successful, sm_failed]
states:
  - PlanMotion:
      source: state_plan
      target_state_type: joint_state
      target_state_name: stability_pose
      plan_name: current_to_stability
      outcomes: [success_to_plan, fail_to_plan]
      transitions: {success_to_plan: sm_successful, fail_to_plan: sm_failed}
"""
WITH_PARAMS = """\
name: just_planning
source: framework_state_machine
node_name: just_planning_sm
outcomes: [sm_successful, sm_failed]
states:
  - PlanMotion:
      source: state_plan
      params: {target_state_type: joint_state, target_state_name: stability_pose, plan_name: current_to_stability,
               outcomes: [success, fail], io_keys: [arm_commander]}
      transitions: {success: sm_successful, fail: sm_failed}
"""
MOCK_TRAJECTORY = """\
name: mock_trajectory
source: framework_state_machine
node_name: mock_trajectory_sm
outcomes: [sm_successful, sm_failed]
states:
  - ConcurrentPlan:
      source: concurrent_state_machine
      params: {state_outcomes: [success, fail], state_io_keys: [arm_commander], target_type: joint_state}
      name: simple_concurrent_planning
      outcomes: [success_plans, fail_plans]
      userdata: self.userdata
      default_outcome: fail_plans
      outcome_map: {success_plans: {PlanInitPose: success, PlanStabPose: success}}
      transitions: {success_plans: MoveInit, fail_plans: sm_failed}
      states:
        - PlanInitPose:
            source: state_plan
            target_state_type: params.target_type
            target_state_name: initial_pose
            plan_name: current_to_init
            outcomes: params.state_outcomes
            io_keys: params.state_io_keys
        - PlanStabPose:
            source: state_plan
            target_state_type: params.target_type
            target_state_name: stability_pose
            plan_name: init_to_stability
            starting_state_type: params.target_type
            starting_state_name: initial_pose
            outcomes: params.state_outcomes
            io_keys: params.state_io_keys
  - MoveInit:
      source: state_move
      params: {outcomes: [success, fail], io_keys: [arm_commander]}
      plan_name: current_to_init
      transitions: {success: MoveStab, fail: sm_failed}
  - MoveStab:
      source: state_move
      params: {outcomes: [success, fail], io_keys: [arm_commander]}
      plan_name: init_to_stability
      transitions: {success: sm_successful, fail: sm_failed}
"""


def build(text: str) -> TaskSpec:
    builder = TaskBuilder(StateCatalogue([STATES]), TemplateCatalogue([TEMPLATES]))
    return builder.build(located_yaml.loads(text, "t.yaml"), "t.yaml")


def faults(text: str) -> str:
    with pytest.raises(TaskFault) as caught:
        build(text)
    return str(caught.value)


@pytest.mark.parametrize("text", [JUST_PLANNING, WITH_PARAMS, MOCK_TRAJECTORY])
def test_the_guides_examples_are_in_order(text: str) -> None:
    build(text)


def test_the_older_names_of_plan_and_move_are_accepted() -> None:
    states = build(MOCK_TRAJECTORY).root.leaf_states()
    assert [state.source.name for state in states] == ["plan", "plan", "move", "move"]


def test_both_ways_to_write_the_first_example_mean_the_same() -> None:
    first, second = (next(iter(build(text).root.leaf_states())).options for text in (JUST_PLANNING, WITH_PARAMS))
    for key in ("target_state_type", "target_state_name", "plan_name"):
        assert first[key] == second[key]


def test_transitions_that_name_other_outcomes_than_declared_are_corrected() -> None:
    printed = JUST_PLANNING.replace(
        "{success_to_plan: sm_successful, fail_to_plan: sm_failed}", "{success: sm_successful, fail: sm_failed}"
    )
    message = faults(printed)
    assert "state 'PlanMotion': outcome 'success' is unknown; allowed: success_to_plan, fail_to_plan" in message
    assert "no transition for 'success_to_plan', 'fail_to_plan'" in message


def test_a_label_given_twice_is_corrected() -> None:
    message = faults(MOCK_TRAJECTORY.replace("- PlanInitPose:", "- PlanStabPose:"))
    assert "t.yaml:23:11: the label 'PlanStabPose' is given twice; first in line 16" in message
    assert "outcome_map: state 'PlanInitPose' is unknown; allowed: PlanStabPose; did you mean" in message


def test_a_misspelt_outcome_is_corrected() -> None:
    message = faults(MOCK_TRAJECTORY.replace("outcomes: [success_plans", "outcomes: [sucess_plans"))
    assert "outcome 'success_plans' is unknown; allowed: sucess_plans, fail_plans; did you mean" in message


def test_a_default_outcome_that_is_none_of_the_outcomes_is_corrected() -> None:
    message = faults(MOCK_TRAJECTORY.replace("default_outcome: fail_plans", "default_outcome: fail"))
    assert "default_outcome 'fail' is unknown" in message
    assert "did you mean 'fail_plans'?" in message


def test_a_misspelt_userdata_key_is_corrected() -> None:
    message = faults(JUST_PLANNING.replace("      plan_name", "      io_keys: [robot_commander]\n      plan_name"))
    assert "needs the userdata key 'robot_commander'" in message
    assert "did you mean 'arm_commander'?" in message


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_shipped_tasks_are_in_order(script: Path) -> None:
    task = check_task(script, [STATES], [TEMPLATES])
    assert task.name == script.stem
    assert task.root.outcomes == ("successful_pipeline", "quit_pipeline")


def test_the_shipped_tasks_differ_only_by_what_simulation_needs() -> None:
    simulated, real = ({state.label for state in check_task(SCRIPTS / f"{name}.yaml", [STATES], [TEMPLATES])
                        .root.leaf_states()} for name in ("simulation_pick", "pick_and_hold"))
    assert simulated - real == {"AllowCollisions", "ForbidCollisions", "ForbidCollisionsAgain"}
    assert real <= simulated
