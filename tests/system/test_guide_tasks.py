# SPDX-License-Identifier: BSD-3-Clause
"""Tasks of the guide and one of the other states move the simulated robot: one launch, task after task."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from modular_framework_testing.ros_session import Launch, RosSession

TESTS = Path(__file__).resolve().parents[1]
API = TESTS.parent / "src" / "modular_framework_api"
GUIDE_TASKS = TESTS / "guide_tasks"
OWN_TASKS = TESTS / "system" / "tasks"
NAMED = yaml.safe_load((API / "config" / "named_joint_states.yaml").read_text())
TASK_TIMEOUT_S = 180.0
AT_POSE_RAD = 0.03

JOINTS = """
import json, rospy
from sensor_msgs.msg import JointState
rospy.init_node("joint_reader", anonymous=True)
message = rospy.wait_for_message("joint_states", JointState, timeout=60)
print(json.dumps(dict(zip(message.name, message.position))))
"""


@pytest.fixture(scope="module")
def session() -> Iterator[RosSession]:
    """A session for the whole module."""
    started = RosSession()
    started.env.pop("DISPLAY", None)
    try:
        yield started
    finally:
        started.stop()


@pytest.fixture(scope="module")
def framework(session: RosSession) -> Launch:
    """The framework, started with the guide's first task, and still there after it."""
    first = os.path.relpath(GUIDE_TASKS / "just_planning.yaml", API / "task_constructor_scripts")
    launch = session.run_framework(gui="false", rviz="false", end_with_task="false", task_constructor_script=first)
    end = time.monotonic() + TASK_TIMEOUT_S
    while "ended with outcome" not in launch.log():
        assert time.monotonic() < end and launch.alive(), launch.log()
        time.sleep(0.1)
    return launch


def run_task(session: RosSession, script: Path) -> subprocess.CompletedProcess[str]:
    """Runs one more task on the running framework."""
    return subprocess.run(
        ["rosrun", "modular_framework_core", "run_task", str(script)],
        env=session.env,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=TASK_TIMEOUT_S,
        check=False,
    )


def assert_arm_at(session: RosSession, pose: str) -> None:
    """Looks where the simulated arm is."""
    reader = subprocess.run(
        [sys.executable, "-c", JOINTS], env=session.env, capture_output=True, text=True, timeout=120, check=True
    )
    joints = json.loads(reader.stdout.splitlines()[-1])
    away = {joint: abs(joints[joint] - value) for joint, value in NAMED[pose].items()}
    assert max(away.values()) < AT_POSE_RAD, away


def test_the_first_task_of_the_guide_plans(framework: Launch) -> None:
    assert "Task 'just_planning' ended with outcome 'sm_successful': SUCCEEDED" in framework.log()


@pytest.mark.parametrize(
    ("script", "outcome", "pose"),
    [
        (GUIDE_TASKS / "just_planning_params.yaml", "sm_successful", ""),
        (GUIDE_TASKS / "mock_trajectory.yaml", "sm_successful", "stability_pose"),
        (GUIDE_TASKS / "nested_initial_pose.yaml", "success", "initial_pose"),
        (OWN_TASKS / "motion_and_more.yaml", "done", "stability_pose"),
        (OWN_TASKS / "as_the_original_generated.py", "sm_successful", "initial_pose"),
        (API / "task_constructor_scripts" / "pick_and_hold.yaml", "successful_pipeline", "stability_pose"),
    ],
    ids=lambda value: value.stem if isinstance(value, Path) else "",
)
def test_the_task_runs_and_the_arm_is_where_it_leads(
    session: RosSession, framework: Launch, script: Path, outcome: str, pose: str
) -> None:
    done = run_task(session, script)
    assert done.returncode == 0, done.stdout
    assert f"Task '{script.stem}' ended with outcome '{outcome}': SUCCEEDED" in done.stdout.splitlines()[-1]
    if pose:
        assert_arm_at(session, pose)
    assert framework.alive(), framework.log()
    if script.stem == "motion_and_more":
        assert "metric rounds_and_the_last_look = 3" in done.stdout
