# SPDX-License-Identifier: BSD-3-Clause
"""Three motions that follow each other, planned one by one or at the same time, each by a pipeline with a seed."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from moveit_msgs.msg import Constraints, JointConstraint, MotionPlanRequest

from modular_framework_testing.planning.planning_wire import ARM, OK, START, add, box, plan, request

ADAPTERS = " ".join(
    f"default_planner_request_adapters/{name}"
    for name in ("AddTimeOptimalParameterization", "FixStartStateBounds", "FixStartStateCollision")
)
SEEDED = tuple(f"seeded_{seed}" for seed in (11, 12, 13))
LAUNCH = (
    """<launch>
  <rosparam ns="move_group/planning_pipelines">
"""
    + "".join(
        f"    {name}: {{planning_plugin: ompl_interface/OMPLPlanner, request_adapters: {ADAPTERS}, "
        f"seed: {name.rpartition('_')[2]}}}\n"
        for name in SEEDED
    )
    + """  </rosparam>
  <include file="$(find ur5_ezgripper_moveit_config)/launch/move_group.launch">
    <arg name="load_robot_description" value="true"/>
  </include>
</launch>"""
)
WAY = (START, [0.2, -1.57, 1.2, -1.2, -1.57, 0.0], [2.6, -1.3, 1.5, -1.7, -1.57, 0.5], START)
"""The motions go from each of these positions [rad] to the next."""

Motion = tuple[tuple[float, tuple[float, ...]], ...]


def put_up_walls() -> None:
    """Puts obstacles between the positions, so that straight motions collide."""
    assert add(box("right", 0.33, 0.42, 1.0, (0.12, 0.12, 0.4)), box("left", -0.33, 0.42, 1.0, (0.12, 0.12, 0.4)))


def requests(pipelines: tuple[str, ...] = SEEDED) -> list[MotionPlanRequest]:
    """Makes the three requests, one for each pipeline."""
    made = []
    for pipeline, start, goal in zip(pipelines, WAY[:-1], WAY[1:], strict=True):
        message = request(
            Constraints(
                joint_constraints=[
                    JointConstraint(name, value, 0.0, 0.0, 1.0) for name, value in zip(ARM, goal, strict=True)
                ]
            ),
            pipeline_id=pipeline,
            allowed_planning_time=60.0,
        )
        message.start_state.is_diff = True
        message.start_state.joint_state.name, message.start_state.joint_state.position = ARM, start
        made.append(message)
    return made


def motion_of(message: MotionPlanRequest) -> Motion:
    """Plans; returns (time from the start [s], positions [rad]) of each point."""
    answer: Any = plan(message)
    assert answer.error_code.val == OK, f"{message.pipeline_id} answered {answer.error_code.val}"
    return tuple(
        (point.time_from_start.to_sec(), tuple(point.positions)) for point in answer.trajectory.joint_trajectory.points
    )


def one_by_one(messages: list[MotionPlanRequest]) -> tuple[list[Motion], float]:
    """Returns the motions, and how long all took [s]."""
    begun = time.monotonic()
    return [motion_of(message) for message in messages], time.monotonic() - begun


def at_once(messages: list[MotionPlanRequest]) -> tuple[list[Motion], float]:
    """Returns the motions, and how long all took [s]."""
    with ThreadPoolExecutor(len(messages)) as pool:
        begun = time.monotonic()
        return list(pool.map(motion_of, messages)), time.monotonic() - begun
