# SPDX-License-Identifier: BSD-3-Clause
"""A move_group node with a robot that follows trajectories, for the tests of its endpoints.

A module says what it needs by a mark: `pytest.mark.move_group(service=..., launch=..., gripper=...)`, all optional.
"""
from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from planning_wire import ARM, GRIPPER, LAUNCH, START, FakeArm, call, tip_pose  # noqa: E402


@dataclass(frozen=True, slots=True)
class Needs:
    """What a module asks for.

    Attributes:
        service: the one that is there when the node is ready.
        launch: text of the launch file.
        gripper: whether the robot's gripper has a controller.
    """

    service: str = "plan_kinematic_path"
    launch: str = LAUNCH
    gripper: bool = False


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "move_group(service, launch, gripper): what the module's node and robot are")


@pytest.fixture(scope="module")
def needs(request: pytest.FixtureRequest) -> Needs:
    mark = request.node.get_closest_marker("move_group")
    return Needs(**(mark.kwargs if mark else {}))


@pytest.fixture(scope="module")
def session(ros_launch: Callable[..., Any], needs: Needs) -> Any:
    """The running node."""
    session = ros_launch(needs.launch)
    session.wait_for_service(needs.service, 120.0)
    return session


@pytest.fixture(scope="module")
def arm(session: Any, needs: Needs) -> Iterator[FakeArm]:
    """The robot."""
    arm = FakeArm(with_gripper=needs.gripper)
    arm.settle()
    yield arm
    arm.close()


@pytest.fixture
def clean_scene(session: Any, arm: FakeArm) -> Iterator[None]:
    """The robot at its start, nothing in the scene; afterwards the node lives."""
    from moveit_msgs.msg import PlanningScene
    from moveit_msgs.srv import ApplyPlanningScene

    start = dict(zip(ARM, START, strict=True)) | {GRIPPER: 0.3}
    arm.cancelled.clear()
    arm.grips.clear()
    arm.positions.update(start)
    arm.settle()
    assert call("apply_planning_scene", ApplyPlanningScene, PlanningScene(is_diff=False)).success
    yield
    assert session.alive(), session.log()


@pytest.fixture(scope="module")
def home(arm: FakeArm) -> Any:
    """Pose of the tip at the start."""
    return tip_pose(START)
