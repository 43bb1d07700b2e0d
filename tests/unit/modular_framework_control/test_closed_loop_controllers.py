# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of joints that take velocities and efforts, in a loop with fake hardware that takes them."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_interface.pid import Pid, PidGains, read_pid
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.controllers.gripper_action_controller import GripperGoalHandle
from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    HardwareInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.plugins import CONTROLLER_BASE, Plugin, PluginIndex
from modular_framework_control.realtime.goal_handle import GoalStatus, RealtimeGoalHandle
from modular_framework_control.trajectory.joint_trajectory import JointTrajectory, TrajectoryPoint
from modular_framework_control.trajectory.trajectory_goal import (
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryGoalHandle,
)
from modular_framework_ros.node_handle import MappingNodeHandle, ParameterError

URDF = """<robot name="r"><joint name="a" type="revolute"><limit lower="-1" upper="1" velocity="9" effort="90"/></joint>
<joint name="b" type="revolute"><limit lower="-2" upper="2" velocity="9" effort="90"/></joint></robot>"""
INTERFACES: dict[str, type[HardwareInterface[Any]]] = {
    "position": PositionJointInterface,
    "velocity": VelocityJointInterface,
    "effort": EffortJointInterface,
}
STIFF = {"p": 100.0, "d": 20.0}
GAINS = {"velocity": {"p": 20.0}, "effort": STIFF}


def parameters(family: str, controller: str, **more: Any) -> dict[str, Any]:
    return {
        "robot_description": URDF,
        "hw": {"joints": ["a", "b"], "command_interface": INTERFACES[family].__name__},
        "c": {"type": f"{family}_controllers/{controller}", **more},
    }


@pytest.fixture
def start(make_loop: Callable[..., Any]) -> Callable[..., Any]:
    def starter(family: str, controller: str, **more: Any) -> Any:
        loop = make_loop(parameters(family, controller, **more))
        loop.spawn("c")
        return loop

    return starter


def joint(loop: Any, family: str, name: str = "a") -> Any:
    return next(handle for handle in loop.robot_hw.get(INTERFACES[family]).handles if handle.name == name)


def goal(*rows: tuple[float, tuple[float, ...]]) -> TrajectoryGoal:
    points = tuple(TrajectoryPoint(time_s, row, (0.0, 0.0), (0.0, 0.0)) for time_s, row in rows)
    return TrajectoryGoal(JointTrajectory.of_points(("a", "b"), points))


@pytest.mark.parametrize("family", ["velocity", "effort"])
def test_a_trajectory_is_followed_by_gains_and_the_goal_is_reached(start: Callable[..., Any], family: str) -> None:
    gains = {"a": GAINS[family], "b": GAINS[family]}
    tolerance = {"trajectory": 0.1, "goal": 0.01}
    loop = start(
        family,
        "JointTrajectoryController",
        joints=["a", "b"],
        gains=gains,
        constraints={"goal_time": 0.5, "a": tolerance, "b": tolerance},
    )
    goal_handle = TrajectoryGoalHandle()
    loop.controllers["c"].submit(goal((1.0, (0.5, -0.4))), goal_handle)
    loop.run(2.0)
    assert (goal_handle.status, goal_handle.result) == (GoalStatus.SUCCEEDED, TrajectoryErrorCode.SUCCESSFUL)
    assert abs(joint(loop, family, "a").position - 0.5) < 0.01 and abs(joint(loop, family, "b").position + 0.4) < 0.01


def test_velocity_feed_forward_alone_follows_what_the_gains_would_lag_behind(start: Callable[..., Any]) -> None:
    def largest_error(velocity_ff: dict[str, float]) -> float:
        loop = start(
            "velocity",
            "JointTrajectoryController",
            joints=["a", "b"],
            velocity_ff=velocity_ff,
            gains={"a": {"p": 1.0}, "b": {"p": 1.0}},
        )
        loop.controllers["c"].submit(goal((1.0, (0.5, 0.5))))
        worst = 0.0
        for _ in range(100):
            loop.step()
            desired = float(loop.controllers["c"].desired_at(loop.time_s - loop.period_s)[0, 0])
            worst = max(worst, abs(desired - joint(loop, "velocity").position))
        return worst

    assert largest_error({"a": 1.0, "b": 1.0}) < 0.03 < largest_error({})


@pytest.mark.parametrize("raises", [False, True])
@pytest.mark.parametrize("family", ["PosVel", "PosVelAcc"])
def test_what_ends_in_motion_leaves_a_position_and_nothing_that_leads_on(
    make_loop: Callable[..., Any], family: str, raises: bool
) -> None:
    prefix = {"PosVel": "pos_vel", "PosVelAcc": "pos_vel_acc"}[family]
    loop = make_loop(
        {
            "hw": {"joints": ["a", "b"], "command_interface": f"{family}JointInterface"},
            "c": {"type": f"{prefix}_controllers/JointTrajectoryController", "joints": ["a", "b"]},
        }
    )
    loop.spawn("c")
    loop.controllers["c"].submit(goal((2.0, (4.0, 4.0))))
    loop.run(0.5)
    handle = next(one for one in loop.robot_hw.interfaces[1].handles if one.name == "a")
    assert handle.command_velocity > 0.1
    assert getattr(handle, "command_acceleration", 1.0) > 0.1
    if raises:
        loop.controllers["c"].on_state = "not callable"
        loop.run(0.1)
        assert loop.states() == {"c": "stopped"}
    else:
        assert loop.switch([], ["c"]) is None
        loop.step()
    assert handle.command == handle.position > 0.1
    assert (handle.command_velocity, getattr(handle, "command_acceleration", 0.0)) == (0.0, 0.0)


@pytest.mark.parametrize("family", ["velocity", "effort"])
def test_a_stopped_controller_leaves_no_command_behind(start: Callable[..., Any], family: str) -> None:
    loop = start(family, "JointTrajectoryController", joints=["a", "b"], gains={"a": GAINS[family], "b": GAINS[family]})
    loop.controllers["c"].submit(goal((1.0, (0.8, 0.8))))
    loop.run(0.3)
    assert joint(loop, family).command != 0.0
    assert loop.switch([], ["c"]) is None
    assert joint(loop, family).command == 0.0


def test_a_controller_that_raises_leaves_no_command_behind(start: Callable[..., Any]) -> None:
    loop = start("velocity", "JointTrajectoryController", joints=["a", "b"], gains={"a": {"p": 9.0}, "b": {"p": 9.0}})
    loop.controllers["c"].submit(goal((1.0, (0.8, 0.8))))
    loop.run(0.3)
    loop.controllers["c"].on_state = "not callable"
    loop.run(0.1)
    assert loop.states() == {"c": "stopped"}
    assert joint(loop, "velocity").command == 0.0


def test_missing_gains_are_named(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(parameters("effort", "JointTrajectoryController", joints=["a", "b"], gains={"a": {"p": 1.0}}))
    with pytest.raises(ControllerError, match="parameter /c/gains/b/p is not set"):
        loop.manager.load_controller("c")


@pytest.mark.parametrize(
    ("family", "controller", "more", "value", "seen"),
    [
        ("position", "JointPositionController", {"joint": "a"}, [0.3], lambda handle: handle.position == 0.3),
        (
            "position",
            "JointGroupPositionController",
            {"joints": ["a", "b"]},
            [0.3, 0.1],
            lambda handle: handle.position == 0.3,
        ),
        (
            "velocity",
            "JointVelocityController",
            {"joint": "a"},
            [0.3],
            lambda handle: handle.velocity == pytest.approx(0.3) and handle.position > 0.1,
        ),
        (
            "velocity",
            "JointGroupVelocityController",
            {"joints": ["a", "b"]},
            [0.3, 0.1],
            lambda handle: handle.velocity == pytest.approx(0.3),
        ),
        (
            "velocity",
            "JointPositionController",
            {"joint": "a", "pid": {"p": 10.0}},
            [0.3],
            lambda handle: abs(handle.position - 0.3) < 0.01,
        ),
        ("effort", "JointEffortController", {"joint": "a"}, [0.3], lambda handle: handle.effort == 0.3),
        (
            "effort",
            "JointGroupEffortController",
            {"joints": ["a", "b"]},
            [0.3, 0.1],
            lambda handle: handle.effort == 0.3,
        ),
        (
            "effort",
            "JointPositionController",
            {"joint": "a", "pid": STIFF},
            [0.3],
            lambda handle: abs(handle.position - 0.3) < 0.01,
        ),
        (
            "effort",
            "JointGroupPositionController",
            {"joints": ["a", "b"], "a": {"pid": STIFF}, "b": {"pid": STIFF}},
            [0.3, 0.1],
            lambda handle: abs(handle.position - 0.3) < 0.01,
        ),
        (
            "effort",
            "JointVelocityController",
            {"joint": "a", "pid": {"p": 20.0}},
            [0.3],
            lambda handle: abs(handle.velocity - 0.3) < 0.01,
        ),
    ],
)
def test_a_command_controller_follows_its_commands_and_refuses_nonsense(
    start: Callable[..., Any],
    family: str,
    controller: str,
    more: dict[str, Any],
    value: list[float],
    seen: Callable[[Any], bool],
) -> None:
    loop = start(family, controller, **more)
    handle = joint(loop, family)
    loop.run(0.5)
    assert handle.position == 0.0
    loop.controllers["c"].submit(value)
    for nonsense in ([], [*value, 1.0], [math.nan] * len(value), [math.inf] * len(value)):
        with pytest.raises(ControllerError, match="finite numbers, for: a"):
            loop.controllers["c"].submit(nonsense)
    loop.run(1.5)
    assert seen(handle), handle


@pytest.mark.parametrize(
    ("family", "more"), [("position", {}), ("velocity", {"pid": {"p": 20.0}}), ("effort", {"pid": STIFF})]
)
def test_a_position_that_is_not_a_number_is_never_commanded(
    start: Callable[..., Any], family: str, more: dict[str, Any]
) -> None:
    loop = start(family, "JointPositionController", joint="a", **more)
    loop.controllers["c"].submit([0.3])
    loop.run(0.5)
    handle, controller = joint(loop, family), loop.controllers["c"]
    handle.state.position = math.nan
    for step in (
        lambda: controller.update(loop.time_s, 0.01),
        lambda: controller.stopping(loop.time_s),
        lambda: controller.starting(loop.time_s),
        lambda: controller.update(loop.time_s, 0.01),
    ):
        step()
        assert handle.command == pytest.approx(0.3 if family == "position" else 0.0)


@pytest.mark.parametrize(
    ("family", "controller"), [("velocity", "JointVelocityController"), ("effort", "JointEffortController")]
)
def test_no_velocity_or_effort_is_left_when_a_command_controller_is_stopped(
    start: Callable[..., Any], family: str, controller: str
) -> None:
    loop = start(family, controller, joint="a")
    loop.controllers["c"].submit([0.5])
    loop.step()
    assert joint(loop, family).command == 0.5
    assert loop.switch([], ["c"]) is None
    assert joint(loop, family).command == 0.0
    assert loop.switch(["c"], []) is None
    assert joint(loop, family).command == 0.0


def test_a_command_that_arrives_while_a_controller_stops_is_not_left(
    start: Callable[..., Any],
) -> None:
    loop = start("velocity", "JointVelocityController", joint="a")
    controller, handle, ended = loop.controllers["c"], joint(loop, "velocity"), threading.Event()

    def keep_submitting() -> None:
        while not ended.is_set():
            controller.submit([0.5])

    interval, thread = sys.getswitchinterval(), threading.Thread(target=keep_submitting)
    sys.setswitchinterval(1.0e-6)
    thread.start()
    try:
        for _ in range(30_000):
            controller.stopping(loop.time_s)
            assert handle.command == 0.0
    finally:
        sys.setswitchinterval(interval)
        ended.set()
        thread.join()


def test_a_position_by_gains_stays_within_the_limits_of_the_description(start: Callable[..., Any]) -> None:
    loop = start("velocity", "JointPositionController", joint="a", pid={"p": 5.0})
    loop.controllers["c"].submit([50.0])
    loop.run(5.0)
    assert joint(loop, "velocity").position == pytest.approx(1.0, abs=1e-3)


def test_a_joint_controller_takes_one_joint(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(parameters("position", "JointPositionController", joint=["a", "b"]))
    with pytest.raises(ControllerError, match="expected the name of one joint"):
        loop.manager.load_controller("c")


def test_the_integral_is_bounded_and_forgotten() -> None:
    pid = Pid(PidGains(1.0, i=2.0, d=0.5, i_clamp_min=-0.3, i_clamp_max=0.3))
    assert pid.command(0.1, 0.2, 0.5) == pytest.approx(0.1 + 0.1 + 0.1)
    assert pid.command(10.0, 0.0, 1.0) == pytest.approx(10.0 + 0.3)
    assert pid.command(math.nan, 0.0, 1.0) == 0.0
    pid.reset()
    assert pid.command(0.0, 0.0, 1.0) == 0.0


def test_gains_that_change_make_no_jump_of_what_was_added_up() -> None:
    pid = Pid(PidGains(0.0, i=1.0, i_clamp_min=-5.0, i_clamp_max=5.0))
    for _ in range(100):
        pid.command(1.0, 0.0, 1.0)  # wound up to 100, of which 5 are used
    pid.gains = PidGains(0.0, i=0.5, i_clamp_min=-50.0, i_clamp_max=50.0)
    assert pid.command(0.0, 0.0, 1.0) == 5.0
    pid.gains = PidGains(0.0, i=0.0, i_clamp_min=-50.0, i_clamp_max=50.0)
    pid.command(1.0, 0.0, 100.0)
    pid.gains = PidGains(0.0, i=10.0, i_clamp_min=-50.0, i_clamp_max=50.0)
    assert pid.command(0.0, 0.0, 1.0) == 0.0, "what was added up while the integral was off is not used"
    pid.gains = replace(pid.gains, i_clamp_max=2.0)
    assert pid.command(1.0, 0.0, 1.0) == 2.0


@pytest.mark.parametrize("gain", [2.0, -2.0])
def test_against_windup_the_sum_stops_at_the_bound(gain: float) -> None:
    def recovered(antiwindup: bool) -> float:
        pid = Pid(PidGains(0.0, i=gain, i_clamp_min=-1.0, i_clamp_max=1.0, antiwindup=antiwindup))
        for _ in range(50):
            pid.command(1.0, 0.0, 1.0)
        return pid.command(-0.25, 0.0, 1.0)

    assert recovered(False) == math.copysign(1.0, gain)
    assert recovered(True) == pytest.approx(math.copysign(0.5, gain))


def test_gains_are_read_with_their_bounds() -> None:
    pid = read_pid(MappingNodeHandle({"p": 1, "i": 2.0, "i_clamp": 3.0, "i_clamp_min": -1.0}))
    assert pid.gains == PidGains(1.0, 2.0, 0.0, -1.0, 3.0, False)
    with pytest.raises(ParameterError, match="/g/p is not set"):
        read_pid(MappingNodeHandle({}, "/g"))


@pytest.mark.parametrize(("max_effort", "largest"), [(0.0, 10.0), (3.0, 3.0)])
def test_a_gripper_of_efforts_reaches_its_goal_within_the_bound_of_its_effort(
    start: Callable[..., Any], max_effort: float, largest: float
) -> None:
    loop = start("effort", "GripperActionController", joint="a", gains={"a": STIFF}, goal_tolerance=0.001)
    goal_handle: GripperGoalHandle = RealtimeGoalHandle()
    handle = joint(loop, "effort")
    loop.controllers["c"].submit(0.1, max_effort, goal_handle)
    seen = 0.0
    while goal_handle.status in (GoalStatus.PENDING, GoalStatus.ACTIVE):
        loop.step()
        seen = max(seen, abs(handle.command))
    assert goal_handle.status is GoalStatus.SUCCEEDED and abs(handle.position - 0.1) <= 0.001
    assert seen == pytest.approx(largest)


def test_a_gripper_of_efforts_that_meets_something_stalls_and_goes_on_squeezing(start: Callable[..., Any]) -> None:
    loop = start("effort", "GripperActionController", joint="a", gains={"a": STIFF}, stall_timeout=0.2)
    goal_handle: GripperGoalHandle = RealtimeGoalHandle()
    loop.controllers["c"].submit(0.9, 2.0, goal_handle)
    for _ in range(300):
        loop.robot_hw.read(loop.time_s, loop.period_s)
        finger = joint(loop, "effort").state
        if finger.position > 0.5:  # an object is there
            finger.position, finger.velocity = 0.5, 0.0
        loop.manager.update(loop.time_s, loop.period_s)
        loop.robot_hw.write(loop.time_s, loop.period_s)
        loop.time_s += loop.period_s
    assert goal_handle.status is GoalStatus.ABORTED and goal_handle.result is not None and goal_handle.result.stalled
    assert joint(loop, "effort").command == 2.0
    assert loop.switch([], ["c"]) is None
    assert joint(loop, "effort").command == 0.0


class Waver(Controller):
    """A user's controller that opens something."""

    interface_class = PositionJointInterface
    closed = 0

    def close(self) -> None:
        type(self).closed += 1
        raise OSError("already gone")


def test_what_a_controller_opened_it_can_close_when_it_is_unloaded(
    make_loop: Callable[..., Any], caplog: pytest.LogCaptureFixture
) -> None:
    types = ControllerTypes()
    types.register("lab/Waver", Waver)
    loop = make_loop({"hw": {"joints": ["a"]}, "w": {"type": "lab/Waver"}}, types=types)
    loop.manager.load_controller("w")
    assert Waver.closed == 0
    loop.manager.unload_controller("w")
    assert Waver.closed == 1 and loop.states() == {}
    assert "controller 'w': close() raised OSError: already gone" in caplog.text


class Raiser(Controller):
    def __init__(self) -> None:
        raise OSError("out of order")


class FixedIndex(PluginIndex):
    """Offers the classes of this module."""

    def __init__(self) -> None:
        super().__init__(CONTROLLER_BASE, dict)

    def _plugins(self) -> dict[str, Plugin]:
        from pathlib import Path

        return {
            f"lab/{name}": Plugin(f"lab/{name}", CONTROLLER_BASE, __name__, name, Path("/lab/plugins.xml"))
            for name in ("Waver", "Raiser")
        }

    def load(self, name: str, expected: type[Any]) -> type[Any]:
        return {"lab/Waver": Waver, "lab/Raiser": Raiser}[name]


def test_controllers_that_packages_offer_are_found_by_their_name() -> None:
    types = ControllerTypes(plugins=FixedIndex())
    assert "lab/Waver" in types.names and isinstance(types.create("lab/Waver"), Waver)
    with pytest.raises(ControllerError, match="'lab/Raiser': its constructor raised OSError: out of order"):
        types.create("lab/Raiser")
    with pytest.raises(ControllerError, match="unknown controller type 'lab/None'; known types: .*lab/Waver"):
        types.create("lab/None")
    with pytest.raises(ControllerError, match="did you mean 'lab/Waver'"):
        types.create("lab/Wavr")
