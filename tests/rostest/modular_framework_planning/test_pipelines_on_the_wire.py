# SPDX-License-Identifier: BSD-3-Clause
"""Pipelines of move_group on the wire.

They are chosen by name; a planner and a collision checker of the user's own, settings of planners, seeds.
"""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rospy
from moveit_msgs.msg import Constraints, JointConstraint, MoveItErrorCodes, PlannerParams, PositionIKRequest
from moveit_msgs.srv import (
    GetPlannerParams,
    GetPositionIK,
    GetStateValidity,
    GetStateValidityRequest,
    QueryPlannerInterfaces,
    SetPlannerParams,
)

from mbf_method.errors import MethodFault
from modular_framework_testing.planning.planning_wire import (
    ARM,
    GROUP,
    LAUNCH,
    OK,
    FakeArm,
    add,
    box,
    call,
    plan,
    report_of,
    request,
    tip_pose,
)

ROOT = Path(__file__).resolve().parents[3]
POSITIONS = (0.2, -1.57, 1.2, -1.2, -1.57, 0.0)
GOAL = Constraints(
    joint_constraints=[JointConstraint(name, value, 0.0, 0.0, 1.0) for name, value in zip(ARM, POSITIONS, strict=True)]
)
ADAPTERS = " ".join(
    f"default_planner_request_adapters/{name}"
    for name in ("AddTimeOptimalParameterization", "FixStartStateBounds", "FixStartStateCollision")
)
FAULTY_PLANNER = ROOT / "tests/unit/mbf_method/faulty_planner.py"
PARAMETERS = f"""<launch>
  <env name="PYTHONPATH" value="{{package}}/src:$(env PYTHONPATH)"/>
  <param name="move_group/collision_detector" value="my_checkers/Named"/>
  <rosparam ns="move_group/planning_pipelines">
    mine: {{{{planning_plugin: my_planners/OneStop}}}}
    external: {{{{planning_plugin: mbf_method/ExternalPlanner, command: [{sys.executable}, {FAULTY_PLANNER}, raises]}}}}
    chomp: {{{{planning_plugin: chomp_interface/CHOMPPlanner}}}}
    wrong: {{{{planning_plugin: ompl_interface/OMPLPlanner, request_adapters: Nonsense}}}}
    seeded: {{{{planning_plugin: ompl_interface/OMPLPlanner, request_adapters: {ADAPTERS}, seed: 5}}}}
  </rosparam>"""

USED = "the checker of the user is made"
CHECKER = f"""
import logging
from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
class Named(ExactCollisionChecker):
    def __init__(self, scene, moving=None, tolerated=()):
        super().__init__(scene, moving, tolerated)
        logging.getLogger("rosout").warning("{USED}")
"""


def guide_planner() -> str:
    """The planner that docs/planning.md shows."""
    section = (ROOT / "docs/planning.md").read_text().split("### A planner of your own")[1]
    block = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert block is not None
    return block[1]


@pytest.fixture(scope="module")
def session(ros_launch: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    package = tmp_path_factory.mktemp("my_robot_moveit_config")
    (package / "src").mkdir()
    (package / "src/my_planners.py").write_text(guide_planner())
    (package / "src/my_checkers.py").write_text(CHECKER)
    session = ros_launch(LAUNCH.replace("<launch>", PARAMETERS.format(package=package)))
    session.wait_for_service("plan_kinematic_path", 120.0)
    session.arm = FakeArm()
    assert add(box("wall", 0.33, 0.42, 1.0, (0.12, 0.12, 0.4)))
    return session


def motion(answer: Any) -> list[tuple[float, tuple[float, ...]]]:
    return [(point.time_from_start.to_sec(), point.positions) for point in answer.trajectory.joint_trajectory.points]


def test_the_planner_of_the_guide_plans(session: Any) -> None:
    assert len(guide_planner().splitlines()) <= 22
    answer, report = report_of(lambda: plan(request(GOAL, pipeline_id="mine", allowed_planning_time=10.0)))
    assert answer.error_code.val == OK, report["reason"]
    assert report["summary"].split()[0] in report["phases_s"] and report["checks"]["search"]["asked"] > 0
    assert motion(answer)[-1][1] == pytest.approx(list(POSITIONS), abs=1e-6)


def test_a_planner_in_its_own_process_plans_and_its_fault_is_in_the_report(session: Any) -> None:
    _, report = report_of(lambda: plan(request(GOAL, pipeline_id="external", planner_id="faulty")))
    assert "the external planner failed: the function of the method raised ValueError" in report["reason"]
    assert report["method_fault"] == MethodFault.RAISED
    near = [JointConstraint(name, report["start"][name] + 0.01, 0.0, 0.0, 1.0) for name in ARM]
    message = request(Constraints(joint_constraints=near), pipeline_id="external")
    answer, report = report_of(lambda: plan(message))
    assert answer.error_code.val == OK, report["reason"]
    assert report["method_time_s"] > 0.0 and report["transport_time_s"] > 0.0 and "method_fault" not in report


def reaches_tip_pose() -> bool:
    message = PositionIKRequest(group_name=GROUP, avoid_collisions=True)
    message.pose_stamped.header.frame_id, message.pose_stamped.pose = "world", tip_pose(POSITIONS)
    return bool(call("compute_ik", GetPositionIK, message).error_code.val == OK)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: plan(request(GOAL, allowed_planning_time=10.0)).error_code.val == OK,
        lambda: plan(request(GOAL, pipeline_id="seeded", allowed_planning_time=20.0)).error_code.val == OK,
        lambda: call("check_state_validity", GetStateValidity, GetStateValidityRequest()).valid,
        reaches_tip_pose,
    ],
    ids=["plan", "plan with a seed", "check_state_validity", "compute_ik"],
)
def test_the_collision_checker_that_the_parameter_names_is_used(session: Any, ask: Callable[[], bool]) -> None:
    made = session.log().count(USED)
    assert ask()
    assert session.log().count(USED) > made


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"pipeline_id": "nobody"}, ("'nobody' is not loaded", "ompl", "mine")),
        ({"pipeline_id": "chomp"}, ("chomp_interface/CHOMPPlanner", "available: ", "mine")),
        ({"pipeline_id": "wrong"}, ("Nonsense", "default_planner_request_adapters/FixStartStateBounds")),
    ],
)
def test_a_name_that_is_not_there_is_refused_with_the_list(session: Any, changes: Any, parts: Any) -> None:
    answer, report = report_of(lambda: plan(request(GOAL, **changes)))
    assert answer.error_code.val == MoveItErrorCodes.PLANNING_FAILED
    assert all(part in report["reason"] for part in parts), report["reason"]


def test_a_planner_that_is_not_there_is_replaced_by_the_default_one_with_a_warning(session: Any) -> None:
    answer, report = report_of(lambda: plan(request(GOAL, planner_id="BiTRRT")))
    assert answer.error_code.val == OK and report["planner_id"] == "RRTConnect"
    assert "planner_id 'BiTRRT': pipeline 'ompl' has no such planner; allowed: RRTConnect" in session.log()


def test_pipelines_and_planners_are_listed_also_by_group(session: Any) -> None:
    answer = call("query_planner_interface", QueryPlannerInterfaces)
    listed = {item.pipeline_id: item for item in answer.planner_interfaces}
    assert {"ompl", "mine", "seeded"} <= listed.keys() and not {"chomp", "wrong"} & listed.keys()
    assert listed["ompl"].name == "OMPL"
    assert {"RRTConnect", "PRM", f"{GROUP}[RRTConnect]"} <= set(listed["ompl"].planner_ids)


def settings(group: str = "") -> dict[str, str]:
    params = call("get_planner_params", GetPlannerParams, "ompl", "RRT", group).params
    return dict(zip(params.keys, params.values, strict=True))


def test_settings_of_planners_are_read_and_changed_for_one_group_or_all(session: Any) -> None:
    before = settings()
    assert before["type"] == "geometric::RRT" and before["goal_bias"] == "0.05"
    bias, kind = PlannerParams(["goal_bias"], ["0.2"], [""]), PlannerParams(["type"], ["geometric::RRT"], [""])
    call("set_planner_params", SetPlannerParams, "ompl", "RRT", GROUP, bias, False)
    assert settings(GROUP) == before | {"goal_bias": "0.2"} and settings() == before
    call("set_planner_params", SetPlannerParams, "ompl", "RRT", "", kind, True)
    assert settings() == {"type": "geometric::RRT"}
    for name, group in (("nobody", ""), ("", ""), ("nobody", "no_group")):
        assert call("get_planner_params", GetPlannerParams, "ompl", name, group).params.keys == []
    uneven = PlannerParams(["range", "goal_bias"], ["0.2"], [])
    for service, kind, arguments, reason in (
        ("get_planner_params", GetPlannerParams, ("nobody", "RRT", ""), "nobody"),
        ("set_planner_params", SetPlannerParams, ("ompl", "RRT", "", uneven, False), "2 keys and 1 values"),
    ):
        with pytest.raises(rospy.ServiceException, match=reason):
            call(service, kind, *arguments)


def test_a_seed_repeats_the_motion_also_while_others_plan(session: Any) -> None:
    message = request(GOAL, pipeline_id="seeded", allowed_planning_time=20.0)
    answers = [plan(message)]
    assert answers[0].error_code.val == OK

    def work(pipeline: str) -> None:
        answer = plan(request(GOAL, pipeline_id=pipeline, allowed_planning_time=20.0))
        if pipeline == "seeded":
            answers.append(answer)

    threads = [threading.Thread(target=work, args=(name,)) for name in ("seeded", "ompl", "seeded")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120.0)
    assert len(answers) == 3 and motion(answers[0]) == motion(answers[1]) == motion(answers[2])
