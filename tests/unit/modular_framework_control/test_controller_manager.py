# SPDX-License-Identifier: BSD-3-Clause
"""Loading, switching and unloading controllers, by the rules of ros_control."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    ControllerInfo,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW, SwitchState
from modular_framework_ros.node_handle import NodeHandle, read_names

BEST_EFFORT, STRICT = 1, 2
JOINTS = {"left": "a", "right": "b", "both": ["a", "b"], "left_too": "a"}
PARAMETERS: dict[str, Any] = {
    "hw": {"joints": ["a", "b"]},
    **{name: {"type": "test/Recorder", "joint": joint} for name, joint in JOINTS.items()},
    "typeless": {"joint": "a"},
    "unknown": {"type": "test/Nothing"},
    "jointless": {"type": "test/Recorder"},
    "elsewhere": {"type": "test/Recorder", "joint": "c"},
    "refusing": {"type": "test/Refusing"},
    "missing_module": {"type": "test/MissingModule"},
}


class Recorder(Controller):
    """Notes what is done to it; raises where asked to."""

    interface_class = PositionJointInterface

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.raises_in = ""
        self.reason = ""

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        for name in read_names(controller_nh, "joint"):
            hw.get_handle(name)
        return True

    def _note(self, call: str) -> None:
        self.calls.append(call)
        if call == self.raises_in:
            raise RuntimeError("broken on purpose")

    def waiting(self, time_s: float) -> None:
        self._note("waiting")

    def aborting(self, time_s: float) -> None:
        self._note("aborting")

    def starting(self, time_s: float) -> None:
        self._note("starting")

    def update(self, time_s: float, period_s: float) -> None:
        self._note("update")

    def stopping(self, time_s: float) -> None:
        self._note("stopping")

    def failed(self, time_s: float, reason: str) -> None:
        self.reason = reason


class Refusing(Recorder):
    """Refuses its parameters without a word."""

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        return False


def types() -> ControllerTypes:
    known = ControllerTypes({"test/MissingModule": "no_such_module:Class"})
    known.register("test/Recorder", Recorder)
    known.register("test/Refusing", Refusing)
    return known


@pytest.fixture
def loop(make_loop: Callable[..., Any], request: pytest.FixtureRequest) -> Any:
    """Three controllers, one running; a test may say how long a switch waits for a cycle [s]."""
    made = make_loop(PARAMETERS, types=types(), update_wait_s=getattr(request, "param", 0.5))
    for name in JOINTS:
        made.manager.load_controller(name)
    assert made.switch(["left"], []) is None
    return made


def test_a_loaded_controller_is_initialized_then_running_then_stopped(loop: Any) -> None:
    assert loop.states()["right"] == "initialized"
    assert loop.switch(["right"], []) is None
    assert loop.states()["right"] == "running"
    assert loop.switch([], ["right"]) is None
    assert loop.states()["right"] == "stopped"
    calls = loop.controllers["right"].calls
    assert (calls[0], calls[-1], set(calls[1:-1])) == ("starting", "stopping", {"update"})


# "left" runs, "right" and "both" do not; "both" and "left_too" share joint a with "left".
@pytest.mark.parametrize(
    ("start", "stop", "strictness", "words", "running"),
    [
        (["right"], [], STRICT, None, {"left", "right"}),
        (["right"], ["left"], STRICT, None, {"right"}),
        ([], [], STRICT, None, {"left"}),
        (["absent"], [], STRICT, "cannot start 'absent': it is not loaded", {"left"}),
        ([], ["absent"], STRICT, "cannot stop 'absent': it is not loaded", {"left"}),
        (["left"], [], STRICT, "already running", {"left"}),
        ([], ["right"], STRICT, "cannot stop 'right': it is initialized", {"left"}),
        (["right"], ["right"], STRICT, "cannot stop 'right'", {"left"}),
        (["left"], ["left"], STRICT, None, {"left"}),
        (["right", "absent"], [], BEST_EFFORT, None, {"left", "right"}),
        (["right"], ["absent"], BEST_EFFORT, None, {"left", "right"}),
        (["left", "right"], [], BEST_EFFORT, None, {"left", "right"}),
        (["right"], ["right"], BEST_EFFORT, None, {"left", "right"}),
        (["right"], ["right", "left"], BEST_EFFORT, None, {"right"}),
        (["right", "absent"], [], 0, None, {"left", "right"}),
        (["left_too"], [], STRICT, "joint 'a' is claimed by 'left' and by 'left_too'", {"left"}),
        (["left_too"], [], BEST_EFFORT, "joint 'a' is claimed", {"left"}),
        (["both"], ["left"], STRICT, None, {"both"}),
        (["both", "right"], ["left"], STRICT, "joint 'b' is claimed", {"left"}),
        (["right"], [], 7, "unknown strictness 7", {"left"}),
    ],
)
def test_switch_rules(
    loop: Any, start: list[str], stop: list[str], strictness: int, words: str | None, running: set[str]
) -> None:
    raised = loop.switch(start, stop, strictness)
    assert (words is None) == (raised is None), raised
    if words is not None:
        assert isinstance(raised, ControllerError) and words in str(raised)
    assert {name for name, state in loop.states().items() if state == "running"} == running


@pytest.mark.parametrize(("fault", "text"), [(OSError("line is dead"), "line is dead"), (("a", 1), "('a', 1)")])
def test_a_fault_that_is_no_text_is_reported_as_one(loop: Any, fault: Any, text: str) -> None:
    heard: list[str] = []
    loop.controllers["left"].on_hardware_fault = lambda time_s, reason: heard.append(reason)
    loop.robot_hw.fault = lambda: fault
    loop.step(2)
    assert loop.manager.fault == text and heard == [text]
    assert loop.states()["left"] == "running"


def test_faults_that_are_none_are_a_fault(loop: Any) -> None:
    loop.robot_hw.faults = lambda: ["protective stop"]
    loop.step()
    assert loop.manager.fault.startswith("fault() raised AttributeError")


def test_a_restart_stops_and_starts_in_one_cycle(loop: Any) -> None:
    assert loop.switch(["left"], ["left"]) is None
    calls = loop.controllers["left"].calls
    assert calls[calls.index("stopping") + 1] == "starting"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("left", "already loaded"),
        ("typeless", "/typeless/type is None"),
        ("absent", "Is the controller file loaded?"),
        ("unknown", "known types: test/MissingModule, test/Recorder"),
        ("jointless", "/jointless/joint"),
        ("elsewhere", "no joint 'c'; it has: a, b"),
        ("refusing", "init() returned False"),
        ("missing_module", "no_such_module"),
    ],
)
def test_a_controller_that_cannot_be_loaded_is_explained(loop: Any, name: str, words: str) -> None:
    before = loop.states()
    with pytest.raises(ControllerError) as caught:
        loop.manager.load_controller(name)
    assert words in str(caught.value)
    assert loop.states() == before


def test_only_a_controller_that_does_not_run_is_unloaded(loop: Any) -> None:
    with pytest.raises(ControllerError, match="is running"):
        loop.manager.unload_controller("left")
    with pytest.raises(ControllerError, match="not loaded"):
        loop.manager.unload_controller("absent")
    loop.manager.unload_controller("right")
    assert "right" not in loop.states()


def test_a_controller_that_raises_is_stopped_and_the_others_go_on(loop: Any) -> None:
    assert loop.switch(["right"], []) is None
    loop.controllers["left"].raises_in = "update"
    loop.step()
    updates = loop.controllers["right"].calls.count("update")
    loop.step(3)
    assert loop.states()["left"] == "stopped"
    assert "broken on purpose" in loop.controllers["left"].reason
    report = next(report for report in loop.manager.list_controllers() if report.info.name == "left")
    assert "update() raised RuntimeError: broken on purpose" in report.failure
    assert loop.controllers["right"].calls.count("update") == updates + 3
    loop.controllers["left"].raises_in = ""
    assert loop.switch(["left"], []) is None
    assert loop.states()["left"] == "running"


def test_a_controller_that_raises_while_starting_fails_the_switch(loop: Any) -> None:
    loop.controllers["right"].raises_in = "starting"
    assert "'right' did not start: starting() raised" in str(loop.switch(["right"], []))
    assert loop.states()["right"] == "stopped"


def test_without_a_control_loop_a_switch_says_so_and_does_not_happen_later(loop: Any) -> None:
    with pytest.raises(ControllerError, match="control loop did not carry out"):
        loop.manager.switch_controller(["right"], [], STRICT)
    loop.step(3)
    assert loop.states()["right"] == "initialized"


def test_hardware_may_take_longer_to_get_ready_than_a_loop_for_its_next_cycle(loop: Any) -> None:
    ready_s = time.monotonic() + 3.0 * loop.update_wait_s
    loop.robot_hw.switch_result = lambda controller=None: (
        SwitchState.DONE if time.monotonic() > ready_s else SwitchState.ONGOING
    )
    assert loop.switch(["right"], []) is None
    assert loop.states()["right"] == "running"
    assert time.monotonic() > ready_s


@pytest.mark.parametrize("jump_back", [True, False])
def test_a_reset_restarts_what_runs(loop: Any, jump_back: bool) -> None:
    loop.controllers["left"].calls.clear()
    if jump_back:
        loop.time_s = 1.0
        loop.step()
    else:
        loop.manager.update(loop.time_s, 0.01, True)
    assert loop.controllers["left"].calls == ["stopping", "starting", "update"]
    assert loop.controllers["right"].calls == []


def test_reloading_needs_force_while_controllers_are_loaded(loop: Any) -> None:
    with pytest.raises(ControllerError, match="left, right, both, left_too"):
        loop.manager.reload_controller_libraries()
    loop.switch([], ["left"])
    loop.manager.reload_controller_libraries(force_kill=True)
    assert loop.states() == {}


class TwoInterfaces(Recorder):
    """Claims joints of a second interface besides its own, and first."""

    interface_class = VelocityJointInterface

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        for name in controller_nh.get_param("position_joints"):
            self.robot_hw.get(PositionJointInterface).get_handle(name)
        for name in controller_nh.get_param("velocity_joints"):
            hw.get_handle(name)
        return True


class TwoInterfaceHardware(RobotHW):
    """Joints that take positions or velocities."""

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        for interface in (PositionJointInterface(), VelocityJointInterface()):
            for name in ("a", "b", "c"):
                interface.register_handle(JointHandle(JointStateHandle(name)))
            self.register_interface(interface)
        return True


@pytest.fixture
def two_interfaces(make_loop: Callable[..., Any]) -> Any:
    known = types()
    known.register("test/TwoInterfaces", TwoInterfaces)
    made = make_loop(
        {
            "apart": {"type": "test/TwoInterfaces", "position_joints": ["c"], "velocity_joints": ["b", "a"]},
            "at_once": {"type": "test/TwoInterfaces", "position_joints": ["a"], "velocity_joints": ["b", "a"]},
        },
        robot_hw=TwoInterfaceHardware(),
        types=known,
    )
    for name in ("apart", "at_once"):
        made.manager.load_controller(name)
    return made


def test_claims_are_listed_in_the_order_of_the_controller(two_interfaces: Any) -> None:
    claims = two_interfaces.manager.list_controllers()[0].info.claimed_resources
    assert [(claim.hardware_interface, claim.resources) for claim in claims] == [
        ("hardware_interface/VelocityJointInterface", ("b", "a")),
        ("hardware_interface/PositionJointInterface", ("c",)),
    ]


def test_a_controller_that_claims_a_joint_through_two_interfaces_is_not_started(two_interfaces: Any) -> None:
    raised = two_interfaces.switch(["at_once"], [], STRICT)
    assert (
        "joint 'a' is claimed by 'at_once' through hardware_interface/VelocityJointInterface and through "
        "hardware_interface/PositionJointInterface" in str(raised)
    )
    assert two_interfaces.switch(["apart"], [], STRICT) is None
    assert two_interfaces.states() == {"apart": "running", "at_once": "initialized"}


def test_types_and_claims_are_listed(loop: Any) -> None:
    assert ("test/Recorder", "controller_interface::ControllerBase") in loop.manager.list_controller_types()
    info = {report.info.name: report.info for report in loop.manager.list_controllers()}["both"]
    assert info.claimed_resources[0].resources == ("a", "b")
    assert info.claimed_resources[0].hardware_interface == "hardware_interface/PositionJointInterface"


def test_closing_stops_what_runs_and_may_be_done_twice(loop: Any) -> None:
    loop.manager.close()
    loop.manager.close()
    assert loop.controllers["left"].calls[-1] == "stopping"


class SlowHardware(MockRobotHW):
    """Takes some asks until it is ready for a controller, and may refuse."""

    def __init__(self) -> None:
        super().__init__()
        self.asks = {"left": 2, "right": 5}
        self.accepts = True
        self.result = SwitchState.DONE
        self.switches: list[tuple[list[str], list[str]]] = []

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> bool:
        return self.accepts

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        self.switches.append(([info.name for info in start], [info.name for info in stop]))

    def switch_result(self, controller: ControllerInfo | None = None) -> SwitchState:
        names = list(self.asks) if controller is None else [controller.name]
        for name in names:
            self.asks[name] -= 1
        return self.result if all(self.asks[name] <= 0 for name in names) else SwitchState.ONGOING


@pytest.fixture
def slow(make_loop: Callable[..., Any], request: pytest.FixtureRequest) -> Any:
    """Hardware that switches slowly; a test may say how long a switch waits for a cycle [s]."""
    made = make_loop(PARAMETERS, SlowHardware(), types(), getattr(request, "param", 0.5))
    for name in ("left", "right"):
        made.manager.load_controller(name)
    return made


def test_controllers_start_together_unless_asked_to_start_as_soon_as_possible(slow: Any) -> None:
    assert slow.switch(["left", "right"], [], STRICT, False) is None
    left, right = slow.controllers["left"].calls, slow.controllers["right"].calls
    assert left.count("update") == right.count("update")
    assert slow.switch([], ["left", "right"]) is None
    slow.robot_hw.asks.update(left=2, right=5)
    left.clear()
    right.clear()
    assert slow.switch(["left", "right"], [], STRICT, True) is None
    assert left.count("update") == right.count("update") + 3
    assert slow.robot_hw.switches[0] == (["left", "right"], [])


def test_hardware_that_takes_too_long_or_refuses_fails_the_switch(slow: Any) -> None:
    slow.robot_hw.asks.update(left=10**6)
    assert "not ready within 0.1 s to start: left" in str(slow.switch(["left"], [], STRICT, True, 0.1))
    slow.robot_hw.asks.update(left=0)
    slow.robot_hw.result = SwitchState.ERROR
    assert "hardware refused to switch for 'left'" in str(slow.switch(["left"], [], STRICT, True))
    slow.robot_hw.accepts = False
    assert "refused to prepare" in str(slow.switch(["left"], []))
    assert slow.states()["left"] == "aborted"


def test_a_controller_hears_each_cycle_that_it_waits_and_once_that_it_is_aborted(slow: Any) -> None:
    calls = slow.controllers["left"].calls
    assert slow.switch(["left"], [], STRICT, True) is None
    assert calls[:2] == ["waiting", "starting"]
    assert slow.switch([], ["left"]) is None
    calls.clear()
    slow.robot_hw.asks.update(left=10**6)
    assert "not ready within 0.1 s" in str(slow.switch(["left"], [], STRICT, True, 0.1))
    assert set(calls[:-1]) == {"waiting"} and calls[-1] == "aborting"
    calls.clear()
    slow.robot_hw.asks.update(left=0)
    slow.robot_hw.result = SwitchState.ERROR
    assert "hardware refused to switch for 'left'" in str(slow.switch(["left"], [], STRICT, True))
    assert calls == ["aborting"] and slow.states()["left"] == "aborted"


@pytest.mark.parametrize(("raises_in", "state"), [("waiting", "stopped"), ("aborting", "aborted")])
def test_a_controller_that_raises_while_it_waits_or_is_aborted_holds_nobody_up(
    slow: Any, raises_in: str, state: str
) -> None:
    slow.controllers["left"].raises_in = raises_in
    slow.robot_hw.asks.update(left=10**6, right=0)
    assert slow.switch(["left", "right"], [], STRICT, True, 0.1) is not None
    assert slow.states() == {"left": state, "right": "running"}
    assert f"{raises_in}() raised RuntimeError" in slow.manager.list_controllers()[0].failure


def test_hardware_that_raises_in_a_switch_leaves_nothing_waiting(slow: Any) -> None:
    def break_down(controller: ControllerInfo | None = None) -> SwitchState:
        raise OSError("line is dead")

    slow.robot_hw.switch_result = break_down
    assert "hardware raised OSError: line is dead" in str(slow.switch(["left"], []))
    assert slow.states()["left"] == "aborted"


@pytest.mark.parametrize("asked", ["check_for_conflict", "prepare_switch"])
def test_hardware_that_raises_before_a_switch_is_reported_and_nothing_is_switched(slow: Any, asked: str) -> None:
    def break_down(*arguments: Any) -> Any:
        raise OSError("line is dead")

    setattr(slow.robot_hw, asked, break_down)
    raised = slow.switch(["left"], [])
    assert isinstance(raised, ControllerError)
    assert "of the hardware raised OSError: line is dead" in str(raised)
    assert slow.states()["left"] == "initialized" and not slow.robot_hw.switches


def test_a_controller_whose_topics_cannot_be_opened_is_closed_and_not_loaded(make_loop: Callable[..., Any]) -> None:
    class Opened(Recorder):
        """Opens something in `init`, as a user's controller may."""

        def close(self) -> None:
            closed.append(True)

    closed: list[bool] = []
    known = types()
    known.register("test/Recorder", Opened)
    loop = make_loop(PARAMETERS, types=known)
    loop.topics_error = OSError("no such topic")
    with pytest.raises(ControllerError, match="cannot load controller 'left': .* raised OSError: no such topic"):
        loop.manager.load_controller("left")
    assert closed == [True] and loop.states() == {}
    loop.topics_error = None
    loop.spawn("left")


@pytest.mark.parametrize("slow", [30.0], indirect=True)
def test_a_switch_under_way_when_the_loop_ends_fails_at_once_and_no_other_is_begun(slow: Any) -> None:
    slow.robot_hw.asks.update(left=10**6)
    raised: list[str] = []

    def ask() -> None:
        with pytest.raises(ControllerError) as caught:
            slow.manager.switch_controller(["left"], [])
        raised.append(str(caught.value))

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    deadline_s = time.monotonic() + 10.0
    while slow.states()["left"] != "waiting" and time.monotonic() < deadline_s:
        slow.step()
    begun_s = time.monotonic()
    slow.manager.stop_all()
    slow.manager.close()
    thread.join(10.0)
    assert time.monotonic() - begun_s < 10.0
    assert raised == ["the switch was not carried out: the control loop has ended"]
    assert slow.states() == {}


@pytest.mark.parametrize("loop", [30.0], indirect=True)
def test_after_the_end_of_the_loop_a_switch_is_refused_at_once(loop: Any) -> None:
    loop.manager.stop_all()
    begun_s = time.monotonic()
    with pytest.raises(ControllerError, match="the control loop has ended"):
        loop.manager.switch_controller(["right"], [])
    assert time.monotonic() - begun_s < 10.0
    loop.step()
    assert (loop.states()["left"], loop.states()["right"]) == ("stopped", "initialized")
