# SPDX-License-Identifier: BSD-3-Clause
"""The move_group node of the suite's .test file with a robot that follows trajectories, for the tests of its endpoints.

A module says what it needs by a mark: `pytest.mark.move_group(service=..., gripper=...)`, both optional. Modules of one
suite share node and robot.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from modular_framework_testing.planning.planning_wire import ARM, GRIPPER, START, FakeArm, call, tip_pose  # noqa: E402


@dataclass(frozen=True, slots=True)
class Needs:
    """What a module asks for.

    Attributes:
        service: the one that is there when the node is ready.
        gripper: whether the robot's gripper has a controller.
    """

    service: str = "plan_kinematic_path"
    gripper: bool = False


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "move_group(service, gripper): what the module needs of node and robot")


@pytest.fixture(scope="module")
def needs(request: pytest.FixtureRequest) -> Needs:
    mark = request.node.get_closest_marker("move_group")
    return Needs(**(mark.kwargs if mark else {}))


@pytest.fixture(scope="module")
def session(ros_session: Any, needs: Needs) -> Any:
    """The running node."""
    ros_session.wait_for_service(needs.service, 120.0)
    return ros_session


@pytest.fixture(scope="session")
def make_arm() -> Iterator[Callable[..., FakeArm]]:
    """Makes the one robot of the suite."""
    made: list[FakeArm] = []

    @cache
    def make(with_gripper: bool) -> FakeArm:
        made.append(FakeArm(with_gripper))
        return made[-1]

    yield make
    for arm in made:
        arm.close()


@pytest.fixture(scope="module")
def arm(session: Any, needs: Needs, make_arm: Callable[..., FakeArm]) -> FakeArm:
    """The robot."""
    arm = make_arm(needs.gripper)
    arm.settle()
    return arm


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
    assert session.answers("/move_group"), session.log()


@pytest.fixture(scope="module")
def home(arm: FakeArm) -> Any:
    """Pose of the tip at the start."""
    return tip_pose(START)
