# SPDX-License-Identifier: BSD-3-Clause
"""Execution of motions, the parts that need no controller."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rospy
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.execution_messages import MotionPart
from modular_framework_planning.move_group.controllers.action_controllers import ActionControllers
from modular_framework_planning.move_group.controllers.execution import TrajectoryExecution
from modular_framework_planning.trajectory_execution.controllers import ControllerSpec
from modular_framework_planning.trajectory_execution.execution_settings import ExecutionSettings
from modular_framework_ros.parameter_declarations import existing_declaration

WHEEL = ControllerSpec("base", "follow", "FollowJointTrajectory", ("wheel",))
ARM = ControllerSpec("arm", "follow", "FollowJointTrajectory", ("elbow",))
GRIPPER = ControllerSpec("gripper", "gripper_cmd", "GripperCommand", ("finger",))


class HeldTime:
    """Notes whether simulated time is held."""

    def __init__(self, enabled: bool) -> None:
        self.enabled = enabled
        self.stands = False

    @contextmanager
    def held(self, _owner: str, during_motions: bool = False) -> Iterator[None]:
        self.stands = self.enabled and during_motions
        yield
        self.stands = False


class StandingRobot:
    """What execution asks of the scene monitor: the joints stand at 0.3, the wheel almost a turn further."""

    def __init__(self, waits_for_planning: bool = False) -> None:
        self.time = HeldTime(waits_for_planning)

    model = SimpleNamespace(
        index={"elbow": 0, "finger": 1, "wheel": 2},
        follower_joints=frozenset({"mirror"}),
        is_continuous=lambda number: number == 2,
    )

    def wait_for_state(self) -> None:
        return

    def catch_up(self) -> None:
        return

    def wait_for_next_state(self, _: float) -> bool:
        return True

    def positions(self) -> Any:
        return np.array([0.3, 0.3, 0.3 + 2 * np.pi])


class RecordedControllers(ActionControllers):
    """Notes the parts of motions instead of sending them; `answers` says by controller what becomes of them."""

    def __init__(self, *specs: ControllerSpec) -> None:
        super().__init__(specs, 1.0)
        self.sent: list[MotionPart] = []
        self.cancelled: list[str] = []
        self.answers: dict[str, Any] = {}

    def connect(self) -> None:
        return

    def prepare(self, parts: Any) -> None:
        return

    def begin(self, part: MotionPart) -> Any:
        self.sent.append(part)
        name = part.controller.name

        def is_done() -> bool:
            answer = self.answers.get(name, True)
            if isinstance(answer, Exception):
                raise answer
            return bool(answer)

        return SimpleNamespace(is_done=is_done, has_begun=lambda: True, cancel=lambda: self.cancelled.append(name))


@pytest.fixture(autouse=True)
def clock() -> Any:
    """Simulated time that stands still until a test moves it."""
    rospy.rostime.set_rostime_initialized(True)
    rospy.rostime._set_rostime(rospy.Time(100))
    yield rospy.rostime._set_rostime
    rospy.rostime.switch_to_wallclock()
    rospy.rostime.set_rostime_initialized(False)


def execution_settings(**settings: Any) -> ExecutionSettings:
    """Those that move_group declares, but for some."""
    declared = existing_declaration("modular_framework_planning", "move_group")
    defaults = {
        item.name: declared.parameters[f"~trajectory_execution/{item.name}"].default
        for item in fields(ExecutionSettings)
    }
    return ExecutionSettings(**{**defaults, **settings})


def executor(controllers: ActionControllers, **settings: Any) -> TrajectoryExecution:
    used = execution_settings(**{"wait_for_trajectory_completion": False, **settings})
    return TrajectoryExecution(controllers, used, StandingRobot())  # type: ignore[arg-type]


def motion(joints: str, *points: tuple[float, list[float]]) -> RobotTrajectory:
    """A trajectory from (time, positions)."""
    message = RobotTrajectory()
    message.joint_trajectory.joint_names = joints.split()
    message.joint_trajectory.points = [
        JointTrajectoryPoint(
            positions=positions, velocities=[0.1] * len(positions), time_from_start=rospy.Duration.from_sec(at)
        )
        for at, positions in points
    ]
    return message


@pytest.mark.parametrize("waits_for_planning", [False, True])
def test_parts_of_a_motion_begin_at_one_instant_where_time_can_be_held(waits_for_planning: bool) -> None:
    robot, stood = StandingRobot(waits_for_planning), []

    class Watched(RecordedControllers):
        def begin(self, part: MotionPart) -> Any:
            stood.append(robot.time.stands)
            return super().begin(part)

    settings = execution_settings(wait_for_trajectory_completion=False)
    execution = TrajectoryExecution(Watched(ARM, GRIPPER), settings, robot)  # type: ignore[arg-type]
    execution.execute(motion("elbow finger", (0.0, [0.3, 0.3]), (1.0, [0.4, 0.4])), threading.Event())
    assert stood == [waits_for_planning, waits_for_planning] and not robot.time.stands


def test_where_time_is_held_a_motion_settles_from_the_state_of_the_instant_in_which_it_ended() -> None:
    class LateRobot(StandingRobot):
        """Has a state from before the end of the motion until it catches up."""

        late, states = False, 0

        def catch_up(self) -> None:
            self.late = False

        def wait_for_next_state(self, _: float) -> bool:
            self.states, self.late = self.states + 1, False
            return True

        def positions(self) -> Any:
            return super().positions() - (0.1 if self.late else 0.0)

    robot = LateRobot(waits_for_planning=True)

    class Moving(RecordedControllers):
        def begin(self, part: MotionPart) -> Any:
            robot.late = True
            return super().begin(part)

    settings = execution_settings(wait_for_trajectory_completion=True)
    execution = TrajectoryExecution(Moving(ARM), settings, robot)  # type: ignore[arg-type]
    execution.execute(motion("elbow", (0.0, [0.3]), (1.0, [0.4])), threading.Event())
    assert robot.states == 1


def test_a_motion_to_where_the_arm_is_succeeds_without_bothering_its_controller() -> None:
    controllers = RecordedControllers(ARM, GRIPPER)
    executor(controllers).execute(motion("elbow", (0.0, [0.301])), threading.Event())
    assert controllers.sent == []


def test_a_motion_that_starts_elsewhere_is_refused_and_the_joint_named() -> None:
    controllers = RecordedControllers(ARM, GRIPPER)
    away = motion("elbow", (0.0, [0.8]), (1.0, [0.9]))
    with pytest.raises(PlanningError, match="'elbow' is 0.5000 from"):
        executor(controllers).execute(away, threading.Event())
    with pytest.raises(PlanningError, match="'elbow' is 0.5000 from"):
        executor(controllers, joints_allowed_start_tolerance={"elbow": 0.4}).execute(away, threading.Event())
    assert controllers.sent == []
    executor(controllers, allowed_start_tolerance=0.0).execute(away, threading.Event())
    executor(controllers, joints_allowed_start_tolerance={"elbow": 0.6}).execute(away, threading.Event())
    assert len(controllers.sent) == 2


def test_a_joint_without_end_starts_where_it_is_whatever_its_turns() -> None:
    controllers = RecordedControllers(WHEEL)
    executor(controllers).execute(motion("wheel", (0.0, [0.3]), (1.0, [0.5])), threading.Event())
    assert len(controllers.sent) == 1


def test_a_gripper_gets_its_goal_even_where_it_is_because_it_is_to_squeeze() -> None:
    controllers = RecordedControllers(ARM, GRIPPER)
    executor(controllers).execute(motion("finger", (0.0, [0.3])), threading.Event())
    assert [part.controller for part in controllers.sent] == [GRIPPER]


def test_a_motion_that_names_no_joint_is_refused() -> None:
    with pytest.raises(PlanningError, match="joint_names is empty"):
        executor(RecordedControllers(ARM)).execute(motion("", (0.0, [])), threading.Event())


def test_a_motion_is_cut_by_the_joints_of_its_controllers_and_mimicking_joints_are_nobodys() -> None:
    controllers = RecordedControllers(ARM, GRIPPER)
    all_joints = motion("finger mirror elbow", (0.0, [0.3, 0.0, 0.3]), (2.0, [0.1, 0.0, 0.7]))
    executor(controllers).execute(all_joints, threading.Event())
    sent = {part.controller.name: part.trajectory for part in controllers.sent}
    assert {name: part.joint_names for name, part in sent.items()} == {"arm": ["elbow"], "gripper": ["finger"]}
    assert sent["arm"].points[-1].positions == [0.7]
    assert sent["gripper"].points[-1].positions == [0.1]


def test_velocity_scaling_executes_the_same_motion_in_less_time() -> None:
    controllers = RecordedControllers(ARM)
    executor(controllers, execution_velocity_scaling=2.0).execute(
        motion("elbow", (0.0, [0.3]), (1.0, [0.7])), threading.Event()
    )
    last = controllers.sent[0].trajectory.points[-1]
    assert (last.time_from_start.to_sec(), list(last.positions), list(last.velocities)) == (0.5, [0.7], [0.2])


def test_a_controller_that_fails_stops_the_others_and_its_words_are_passed_on() -> None:
    controllers = RecordedControllers(ARM, GRIPPER)
    controllers.answers = {"arm": False, "gripper": PlanningError(ErrorCode.CONTROL_FAILED, "the jaw is stuck")}
    both = motion("elbow finger", (0.0, [0.3, 0.3]), (1.0, [0.5, 0.5]))
    with pytest.raises(PlanningError, match="the jaw is stuck"):
        executor(controllers).execute(both, threading.Event())
    assert "arm" in controllers.cancelled


@pytest.mark.parametrize(
    ("settings", "spec", "late_s"),
    [
        ({}, {}, 1.7),
        ({"allowed_execution_duration_scaling": 2.0}, {}, 2.6),
        ({"allowed_goal_duration_margin": 2.0}, {}, 3.2),
        ({}, {"duration_scaling": 3.0, "duration_margin": 1.0}, 4.1),
    ],
)
def test_a_motion_that_takes_too_long_is_stopped(clock: Any, settings: Any, spec: Any, late_s: float) -> None:
    controllers = RecordedControllers(replace(ARM, **spec))
    controllers.answers["arm"] = False
    execution = executor(controllers, **settings)
    slow = motion("elbow", (0.0, [0.3]), (1.0, [0.5]))
    ended: list[PlanningError] = []

    def execute() -> None:
        try:
            execution.execute(slow, threading.Event())
        except PlanningError as error:
            ended.append(error)

    thread = threading.Thread(target=execute)
    thread.start()
    while not controllers.sent:
        time.sleep(0.005)
    clock(rospy.Time.from_sec(100.0 + late_s - 0.2))
    thread.join(0.1)
    assert not ended
    clock(rospy.Time.from_sec(100.0 + late_s))
    thread.join(20.0)
    assert ended[0].code is ErrorCode.TIMED_OUT
    assert controllers.cancelled == ["arm"]


def test_a_motion_whose_end_came_while_the_process_stood_still_has_not_taken_too_long(clock: Any) -> None:
    controllers = RecordedControllers(ARM)
    controllers.answers["arm"] = False

    class Stall(threading.Event):
        """Stands still in the first wait; the end of the motion is known only some polls later."""

        polls = 0

        def wait(self, timeout: float | None = None) -> bool:
            self.polls += 1
            if self.polls == 1:
                time.sleep(0.4)
                clock(rospy.Time(110))
            controllers.answers["arm"] = self.polls > 5
            return super().wait(timeout)

    executor(controllers).execute(motion("elbow", (0.0, [0.3]), (1.0, [0.5])), Stall())
    assert controllers.cancelled == []


def test_a_motion_of_a_fake_controller_ends_when_joint_states_shows_it_however_late(clock: Any) -> None:
    controllers = RecordedControllers(replace(ARM, kind="interpolate"))
    controllers.answers["arm"] = False

    class Late(threading.Event):
        polls = 0

        def wait(self, timeout: float | None = None) -> bool:
            self.polls += 1
            clock(rospy.Time(100 + self.polls))
            controllers.answers["arm"] = self.polls > 5
            return super().wait(timeout)

    executor(controllers).execute(motion("elbow", (0.0, [0.3]), (1.0, [0.5])), Late())
    assert controllers.cancelled == []


def test_without_monitoring_a_motion_may_take_for_ever(clock: Any) -> None:
    controllers = RecordedControllers(ARM)
    controllers.answers["arm"] = False
    execution = executor(controllers, execution_duration_monitoring=False)
    clock(rospy.Time(100))
    cancelled = threading.Event()
    threading.Timer(0.1, lambda: clock(rospy.Time(900))).start()
    threading.Timer(0.3, cancelled.set).start()
    with pytest.raises(PlanningError, match="stopped on request"):
        execution.execute(motion("elbow", (0.0, [0.3]), (1.0, [0.5])), cancelled)


def test_a_node_that_only_plans_says_so() -> None:
    execution = TrajectoryExecution(None, execution_settings(), StandingRobot())  # type: ignore[arg-type]
    with pytest.raises(PlanningError, match="allow_trajectory_execution is false"):
        execution.execute(motion("elbow", (0.0, [0.3])), threading.Event())
    assert execution.describe() == "no execution of motions"


def test_closing_stops_the_motion_and_waits_until_it_has_ended() -> None:
    controllers = RecordedControllers(ARM)
    controllers.answers["arm"] = False
    execution = executor(controllers)
    ended = []

    def execute() -> None:
        with pytest.raises(PlanningError, match="stopped on request"):
            execution.execute(motion("elbow", (0.0, [0.3]), (1.0, [0.5])), threading.Event())
        ended.append(True)

    thread = threading.Thread(target=execute)
    thread.start()
    while not controllers.sent:
        time.sleep(0.005)
    execution.close()
    thread.join(20.0)
    assert ended
    assert controllers.cancelled == ["arm"]
    execution.close()  # a second time does nothing


def test_motions_of_different_joints_run_at_the_same_time_and_those_of_the_same_do_not() -> None:
    controllers = RecordedControllers(ARM, GRIPPER, WHEEL)
    controllers.answers = {ARM.name: False}
    execution, cancelled = executor(controllers), threading.Event()
    moving = motion("elbow", (0.0, [0.3]), (1.0, [0.5]))
    first = threading.Thread(target=lambda: stopped(execution, moving, cancelled), daemon=True)
    first.start()
    while not controllers.sent:  # the time limit of the suite bounds this
        time.sleep(0.01)
    execution.execute(motion("wheel", (0.0, [0.3]), (1.0, [0.5])), threading.Event())
    assert [part.controller.name for part in controllers.sent] == [ARM.name, WHEEL.name]
    with pytest.raises(PlanningError, match="another motion of .*elbow.* is running"):
        execution.execute(moving, threading.Event())
    execution.close()
    first.join(5.0)
    assert not first.is_alive() and controllers.cancelled == [ARM.name]


def stopped(execution: TrajectoryExecution, trajectory: RobotTrajectory, cancelled: threading.Event) -> None:
    with pytest.raises(PlanningError, match="stopped on request"):
        execution.execute(trajectory, cancelled)
