# SPDX-License-Identifier: BSD-3-Clause
"""The examples of the original's guide: those that were right work as printed, the others get the correction."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from task_folders import TEMPLATES

from modular_framework_core.files import located_yaml
from modular_framework_core.files.faults import FaultList, TaskFault
from modular_framework_core.task_constructor import loading, task_graph
from modular_framework_core.task_constructor.pipeline import check_task, construct_task
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_constructor.task_builder import TaskBuilder
from modular_framework_core.task_constructor.task_spec import TaskSpec
from modular_framework_core.task_constructor.template_catalogue import TemplateCatalogue

SOURCE = Path(__file__).parents[3] / "src"
STATES = SOURCE / "modular_framework_states" / "src" / "modular_framework_states" / "states"
SCRIPTS = SOURCE / "modular_framework_api" / "task_constructor_scripts"

GUIDE_TASKS = Path(__file__).parents[2] / "guide_tasks"
JUST_PLANNING, WITH_PARAMS, MOCK_TRAJECTORY = (
    (GUIDE_TASKS / f"{name}.yaml").read_text() for name in ("just_planning", "just_planning_params", "mock_trajectory")
)
IN_ORDER = sorted(
    [
        *(
            GUIDE_TASKS / f"{name}.yaml"
            for name in ("just_planning", "just_planning_params", "mock_trajectory", "nested_initial_pose")
        ),
        *SCRIPTS.glob("*.yaml"),
    ]
)


def build(text: str) -> TaskSpec:
    faults = FaultList()
    builder = TaskBuilder(StateCatalogue([STATES]), TemplateCatalogue([TEMPLATES]), faults)
    return builder.build(located_yaml.loads(text, "t.yaml", faults), "t.yaml")


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


@pytest.mark.parametrize(
    ("script", "reported"),
    [
        (
            "just_planning_all_options",
            (
                "19:21: state 'PlanMotion': outcome 'success' is unknown; allowed: success_to_plan, fail_to_plan; "
                "did you mean 'success_to_plan'?",
                "19:45: state 'PlanMotion': outcome 'fail' is unknown; allowed: success_to_plan, fail_to_plan; "
                "did you mean 'fail_to_plan'?",
                "8:5: state 'PlanMotion': no transition for 'success_to_plan', 'fail_to_plan'",
            ),
        ),
        (
            "mock_trajectory_as_printed",
            (
                "14:24: default_outcome 'fail' is unknown; allowed: sucess_plans, fail_plans; "
                "did you mean 'fail_plans'?",
                "16:21: state 'ConcurrentPlan': outcome 'success_plans' is unknown; allowed: sucess_plans, fail_plans; "
                "did you mean 'sucess_plans'?",
                "15:37: outcome_map: state 'PlanInitPose' is unknown; allowed: PlanStabPose",
                "25:11: the label 'PlanStabPose' is given twice; first in line 18",
            ),
        ),
        ("layout", ("15:56: the key '<state_outcome3>' is given twice; first in line 15",)),
    ],
)
def test_what_the_guide_prints_with_slips_is_refused_with_all_corrections_at_once(
    script: str, reported: tuple[str, ...]
) -> None:
    with pytest.raises(TaskFault) as caught:
        check_task(GUIDE_TASKS / f"{script}.yaml", [STATES], [TEMPLATES])
    assert all(f"{script}.yaml:{line}" in str(caught.value) for line in reported), str(caught.value)


def test_following_the_corrections_puts_the_printed_examples_in_order() -> None:
    printed = (GUIDE_TASKS / "just_planning_all_options.yaml").read_text()
    build(printed.replace("{success: sm_successful, fail:", "{success_to_plan: sm_successful, fail_to_plan:"))
    printed = (GUIDE_TASKS / "mock_trajectory_as_printed.yaml").read_text()
    printed = printed.replace("default_outcome: fail", "default_outcome: fail_plans")
    build(printed.replace("sucess_plans", "success_plans").replace("- PlanStabPose:", "- PlanInitPose:", 1))


def test_the_placeholders_of_the_layout_are_reported_as_no_names() -> None:
    message = faults((GUIDE_TASKS / "layout.yaml").read_text().replace("<state_outcome3>: <another", "x: <another"))
    for placeholder in ("<state_machine_name>", "<template_filename>", "<state_filename>"):
        assert placeholder in message


@pytest.mark.parametrize("script", IN_ORDER, ids=lambda path: path.stem)
def test_the_tasks_are_checked_drawn_generated_and_loaded(script: Path, tmp_path: Path) -> None:
    task, module = construct_task(script, [STATES], [TEMPLATES], tmp_path)
    task_graph.write(task, tmp_path / "task.svg")
    drawn = ElementTree.parse(tmp_path / "task.svg").getroot()
    texts = {"".join(item.itertext()).strip() for item in drawn.iter("{http://www.w3.org/2000/svg}text")}
    assert {state.label for state in task.root.leaf_states()} <= texts
    assert callable(loading.machine_factory(loading.load_module(module)))
    assert module == tmp_path / f"{task.name}.py"


def test_transitions_that_name_other_outcomes_than_declared_are_corrected() -> None:
    printed = JUST_PLANNING.replace(
        "{success_to_plan: sm_successful, fail_to_plan: sm_failed}", "{success: sm_successful, fail: sm_failed}"
    )
    message = faults(printed)
    assert "state 'PlanMotion': outcome 'success' is unknown; allowed: success_to_plan, fail_to_plan" in message
    assert "no transition for 'success_to_plan', 'fail_to_plan'" in message


def test_a_label_given_twice_is_corrected() -> None:
    message = faults(MOCK_TRAJECTORY.replace("- PlanInitPose:", "- PlanStabPose:"))
    assert "t.yaml:25:11: the label 'PlanStabPose' is given twice; first in line 18" in message
    assert "outcome_map: state 'PlanInitPose' is unknown; allowed: PlanStabPose" in message


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
    simulated, real = (
        {state.label for state in check_task(SCRIPTS / f"{name}.yaml", [STATES], [TEMPLATES]).root.leaf_states()}
        for name in ("simulation_pick", "pick_and_hold")
    )
    assert simulated - real == {"AllowCollisions", "ForbidCollisions", "ForbidCollisionsAgain"}
    assert real <= simulated
