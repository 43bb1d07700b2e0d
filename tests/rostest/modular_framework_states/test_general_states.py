# SPDX-License-Identifier: BSD-3-Clause
"""States that are not about motions: waiting, counting, any topic, service and action, managers, objects, figures."""

from __future__ import annotations

import itertools
import json
import logging
import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from actionlib.server_goal_handle import ServerGoalHandle
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from control_msgs.msg import GripperCommand, GripperCommandAction, GripperCommandGoal, GripperCommandResult
from gazebo_msgs.srv import DeleteModel, DeleteModelResponse, SpawnModel, SpawnModelResponse
from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, Quaternion
from rospy.impl.tcpros_base import TCPROSTransport
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, SetBoolResponse

import smach
from modular_framework_core import srv
from modular_framework_core.commander.arm_commander import CommanderError
from modular_framework_ros.action_client import is_connected
from modular_framework_ros.action_server import SteadyActionServer
from modular_framework_ros.connections import ros_goal_senders
from modular_framework_ros.connections.ros_node_calls import NodeCallError
from modular_framework_states.states.call_action import CallAction
from modular_framework_states.states.call_service import CallService
from modular_framework_states.states.counter import Counter
from modular_framework_states.states.delete_object import DeleteObject
from modular_framework_states.states.load import Load
from modular_framework_states.states.log_metric import LogMetric
from modular_framework_states.states.reinitialise_managers import ReinitialiseManagers
from modular_framework_states.states.set_planner import SetPlanner
from modular_framework_states.states.spawn_object import SpawnObject
from modular_framework_states.states.store import Store
from modular_framework_states.states.wait import Wait
from modular_framework_states.states.wait_for_message import WaitForMessage
from modular_framework_testing.ros_session import until

SERVERS = itertools.count(1)
LAUNCH = """<launch><node name="managers" pkg="modular_framework_core" type="managers" output="screen" required="true"
args="{file}"/></launch>"""


@pytest.fixture(scope="module", autouse=True)
def managers(ros_launch, tmp_path_factory: pytest.TempPathFactory):
    file = tmp_path_factory.mktemp("config") / "states.yaml"
    file.write_text("up: {a: 1}\n")
    session = ros_launch(LAUNCH.format(file=file))
    session.wait_for_service("/get_object_type", 60)
    return session


def run(state: smach.State, **values: object) -> tuple[str, smach.UserData]:
    machine = smach.StateMachine(outcomes=["success", "fail", "preempted"])
    for key, value in values.items():
        machine.userdata[key] = value
    with machine:
        smach.StateMachine.add("ONLY", state, transitions={})
    return machine.execute(), machine.userdata


def names(kind: str) -> list[str]:
    return list(rospy.ServiceProxy(f"list_{kind}", srv.ListMessages)().names)


def test_wait_takes_its_time_and_ends_when_stopped() -> None:
    begun = time.monotonic()
    assert run(Wait(0.3))[0] == "success"
    assert 0.3 <= time.monotonic() - begun < 10.0
    state = Wait(60.0)
    threading.Timer(0.2, state.request_preempt).start()
    begun = time.monotonic()
    assert run(state)[0] == "fail"
    assert state.reason == "stopped on request" and time.monotonic() - begun < 20.0


def test_wait_for_message_takes_any_type_and_passes_over_what_is_not_expected() -> None:
    publisher = rospy.Publisher("points", PointStamped, queue_size=10)
    state = WaitForMessage("points", 60.0, {"point": {"x": 2.0}}, output_keys=("message",))

    def publish() -> None:
        while publisher.get_num_connections() == 0:
            time.sleep(0.01)
        for x in (1.0, 2.0):
            message = PointStamped()
            message.point.x = x
            publisher.publish(message)

    threading.Thread(target=publish, daemon=True).start()
    outcome, userdata = run(state)
    assert outcome == "success", state.reason
    assert userdata.message.point.x == 2.0
    late = WaitForMessage("points", 0.3, {"point": {"x": 9.0}})
    threading.Thread(target=publish, daemon=True).start()
    assert run(late)[0] == "fail"
    assert "no message as expected came on topic '/points' within 0.3 s" in late.reason


def test_wait_for_message_and_other_subscribers_of_its_node_do_not_disturb_each_other() -> None:
    heard: list[PointStamped] = []
    publisher = rospy.Publisher("shared_points", PointStamped, queue_size=1, latch=True)
    publisher.publish(PointStamped())
    before = rospy.Subscriber("shared_points", PointStamped, heard.append)
    state = WaitForMessage("shared_points", 60.0, {"point": {"x": 0.0}})
    assert run(state)[0] == "success", state.reason
    before.unregister()
    nobody = WaitForMessage("unknown_points", 0.3)
    assert run(nobody)[0] == "fail"
    assert "no message came on topic '/unknown_points' within 0.3 s (nobody publishes it)" in nobody.reason


def test_a_counter_is_positive_its_number_of_times_and_begins_anew() -> None:
    state = Counter(2, output_keys=("counter",))
    assert [run(state)[0] for _ in range(4)] == ["success", "success", "fail", "success"]
    assert run(state)[1].counter == 2


def test_call_service_finds_the_type_and_is_positive_only_when_the_answer_is() -> None:
    service = rospy.Service("switch", SetBool, lambda request: SetBoolResponse(request.data, "the lamp is broken"))
    outcome, userdata = run(CallService("switch", {"data": True}, output_keys=("response",)))
    assert outcome == "success" and userdata.response.success
    cases = [
        (CallService("switch", {"data": False}), "answered success: false: the lamp is broken"),
        (CallService("switch", {"data": True}, {"message": "fine"}), "message is 'the lamp is broken', expected"),
        (CallService("switch", {"on": True}), "its fields are data (bool)"),
        (CallService("switch", {"data": "yes"}), "do not fit std_srvs/SetBoolRequest"),
        (CallService("nobody", timeout=0.3), "was not advertised within 0.3 s"),
    ]
    for state, reason in cases:
        assert run(state)[0] == "fail"
        assert reason in state.reason
    service.shutdown()


def test_fields_of_requests_come_from_userdata_and_fields_of_the_answer_go_there() -> None:
    asked: list[PoseStamped] = []

    def answer(request):
        asked.append(request.pose_stamped)
        return srv.AddPoseStampedResponse(True)

    service = rospy.Service("place_it", srv.AddPoseStamped, answer)
    pose = PoseStamped(header=Header(frame_id="table"), pose=Pose(Point(0.1, 0.2, 0.3), Quaternion(w=1.0)))
    request = {
        "pose_stamped": {"header": {"frame_id": "world"}, "pose": "userdata.where.pose"},
        "pose_name": "userdata.who",
    }
    ask = CallService(
        "place_it", request, input_keys=("where", "who"), keep={"placed": "success"}, output_keys=("placed",)
    )
    outcome, userdata = run(ask, where=pose, who="me")
    assert (outcome, userdata.placed, asked[0].header.frame_id, asked[0].pose) == ("success", True, "world", pose.pose)
    for values, reason in (
        ({"where": pose.pose, "who": "me"}, "'pose': there is no 'pose'; there are: position, "),
        ({"where": pose, "who": 3}, "do not fit modular_framework_core/AddPoseStampedRequest"),
        ({"where": None, "who": "me"}, "userdata 'where' is empty; add a previous state that writes the key"),
        ({"who": "me"}, "'userdata.where.pose' refers to userdata that does not exist"),
    ):
        assert run(ask, **values)[0] == "fail"
        assert reason in ask.reason, ask.reason
    service.shutdown()


def test_a_field_of_the_answer_decides_about_the_outcome_where_it_is_named() -> None:
    codes = iter((0, 1, 2, 7, 0))
    service = rospy.Service(
        "detect",
        srv.MessageFile,
        lambda request: srv.MessageFileResponse(success=False, message="looked", count=next(codes)),
    )
    outcomes = ("found", "nothing", "fail")
    state = CallService("detect", outcome_field="count", outcomes=outcomes)
    assert [ended(state) for _ in range(4)] == ["found", "nothing", "fail", "fail"]
    assert (
        "count is 7, which selects no outcome; expected a boolean, an index from 0 to 2, or one of found"
        in state.reason
    )
    codes = iter((10, 20, 21, 3))
    state = CallService(
        "detect",
        outcome_field="count",
        outcomes=outcomes,
        keep={"said": "message"},
        output_keys=("said",),
        outcome_values={"found": 10, "nothing": [20, 21]},
    )
    assert [ended(state) for _ in range(4)] == ["found", "nothing", "nothing", "fail"]
    assert "count is 3, which is none of outcome_values" in state.reason
    service.shutdown()
    for wrong in (
        {"outcome_values": {"found": 1}},
        {"outcome_field": "a", "outcome_values": {"fond": 1}},
        {"keep": {"said": "message"}},
    ):
        with pytest.raises(ValueError, match="outcome_field; name the field|outcome_values names|keep writes"):
            CallService("detect", outcomes=outcomes, **wrong)


def ended(state: smach.State) -> str:
    """Runs a state in a machine with its outcomes."""
    machine = smach.StateMachine(outcomes=list(state.get_registered_outcomes()))
    with machine:
        smach.StateMachine.add("ONLY", state)
    return machine.execute()


class Gripper:
    """An action server that closes, or refuses, or never ends."""

    def __init__(self) -> None:
        self.preempted = threading.Event()
        self._server = actionlib.SimpleActionServer("hand", GripperCommandAction, self._execute, auto_start=False)
        self._server.start()

    def _execute(self, goal) -> None:
        if goal.command.position > 1.0:
            while not self._server.is_preempt_requested():
                time.sleep(0.01)
            self.preempted.set()
            self._server.set_preempted()
        elif goal.command.position < 0.0:
            self._server.set_aborted(GripperCommandResult(), "fingers do not open that far")
        else:
            self._server.set_succeeded(GripperCommandResult(position=goal.command.position, reached_goal=True))


def test_no_result_is_lost_while_its_topic_is_still_being_connected(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine may need seconds for the connection of one topic, and a goal that needs no motion ends at once."""
    connect, may_connect = TCPROSTransport.connect, threading.Event()

    def connect_later(transport: TCPROSTransport, *where: object, **options: object) -> None:
        if transport.name == "/quick_hand/result":
            may_connect.wait(60.0)
        connect(transport, *where, **options)

    monkeypatch.setattr(TCPROSTransport, "connect", connect_later)
    ended = threading.Event()

    def answer(goal: ServerGoalHandle) -> None:
        goal.set_accepted()
        goal.set_succeeded(GripperCommandResult(reached_goal=True))
        ended.set()

    server = SteadyActionServer("quick_hand", GripperCommandAction, answer, auto_start=False)
    server.start()
    threading.Timer(1.0, may_connect.set).start()
    state = CallAction("quick_hand", {"command": {"position": 0.5}}, timeout=20.0, server_timeout=60.0)
    assert run(state)[0] == "success", state.reason
    assert ended.is_set()


@pytest.fixture
def quick_grip() -> Iterator[SteadyActionServer]:
    """A server whose goals end at once; no client has sent goals under its name before."""

    def answer(goal: ServerGoalHandle) -> None:
        goal.set_accepted()
        goal.set_succeeded(GripperCommandResult(position=goal.get_goal().command.position))

    server = SteadyActionServer(f"quick_grip_{next(SERVERS)}", GripperCommandAction, answer, auto_start=False)
    server.start()
    yield server
    server.stop()


@pytest.mark.parametrize("answers", [True, False], ids=["a client that counts late", "a client that cannot be called"])
def test_a_goal_is_reported_after_its_client_has_answered_a_call(
    monkeypatch: pytest.MonkeyPatch, quick_grip: SteadyActionServer, answers: bool
) -> None:
    called, may_answer = threading.Event(), threading.Event()

    def published_bytes(address: str, topic: str, timeout_s: float) -> int:
        called.set()
        assert may_answer.wait(60.0)
        if not answers:
            raise NodeCallError(address)
        return 10**6

    monkeypatch.setattr(ros_goal_senders, "published_bytes", published_bytes)
    client = actionlib.SimpleActionClient(quick_grip.ns, GripperCommandAction)
    assert client.wait_for_server(rospy.Duration(60.0))
    lists: list[GoalStatusArray] = []
    subscriber = rospy.Subscriber(f"{quick_grip.ns}/status", GoalStatusArray, lists.append)
    client.send_goal(GripperCommandGoal())
    assert called.wait(60.0)
    seen = len(lists)
    until(lambda: len(lists) > seen, "another status message")
    assert not any(message.status_list for message in lists) and client.get_result() is None
    may_answer.set()
    assert client.wait_for_result(rospy.Duration(60.0))
    until(lambda: any(item.status == GoalStatus.SUCCEEDED for item in lists[-1].status_list), "the status of the goal")
    subscriber.unregister()


@pytest.mark.parametrize(
    "server_is_new", [False, True], ids=["the client's first server", "a server that was restarted"]
)
def test_no_client_is_told_of_a_goal_while_it_still_sends_it(
    quick_grip: SteadyActionServer, caplog: pytest.LogCaptureFixture, server_is_new: bool
) -> None:
    """A publisher of rospy yields the processor once the message is queued; a busy machine returns it late."""
    client = actionlib.SimpleActionClient(quick_grip.ns, GripperCommandAction)
    assert client.wait_for_server(rospy.Duration(60.0))
    if server_is_new:
        for position in (0.1, 0.2):
            client.send_goal_and_wait(GripperCommandGoal(GripperCommand(position=position)))
        quick_grip.stop()
        until(lambda: not client.action_client.pub_goal.get_num_connections(), "the end of the connection")
        quick_grip.start()
        until(lambda: is_connected(client), "the new connections")
        client.send_goal_and_wait(GripperCommandGoal())  # the new server learns what the client has published
    (connection,) = client.action_client.pub_goal.impl.connections
    write = connection.write_data

    def write_and_yield(data: bytes) -> bool:
        write(data)
        time.sleep(0.1)
        return True

    connection.write_data = write_and_yield
    logging.getLogger("rosout").addHandler(caplog.handler)
    try:
        for position in (0.3, 0.4, 0.5):
            client.send_goal(GripperCommandGoal(GripperCommand(position=position)))
            assert client.wait_for_result(rospy.Duration(20.0)) and client.get_result().position == position
    finally:
        logging.getLogger("rosout").removeHandler(caplog.handler)
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]


def test_a_goal_that_is_cancelled_before_it_is_reported_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """An actionlib client takes a goal it has cancelled for lost when a status does not contain the goal."""
    called, may_answer = threading.Event(), threading.Event()

    def published_bytes(address: str, topic: str, timeout_s: float) -> int:
        called.set()
        assert may_answer.wait(60.0)
        return 10**6

    monkeypatch.setattr(ros_goal_senders, "published_bytes", published_bytes)
    server = SteadyActionServer(
        "slow_grip", GripperCommandAction, ServerGoalHandle.set_accepted, ServerGoalHandle.set_canceled, False
    )
    server.start()
    client = actionlib.SimpleActionClient("slow_grip", GripperCommandAction)
    assert client.wait_for_server(rospy.Duration(60.0))
    client.send_goal(GripperCommandGoal())
    assert called.wait(60.0)
    client.cancel_goal()
    threading.Timer(3.0 / server.status_frequency, may_answer.set).start()
    assert client.wait_for_result(rospy.Duration(60.0))
    assert client.get_state() == GoalStatus.PREEMPTED
    server.stop()


def test_call_action_sends_a_goal_and_reports_how_it_ended() -> None:
    gripper = Gripper()
    outcome, userdata = run(
        CallAction("hand", {"command": {"position": 0.5}}, {"reached_goal": True}, output_keys=("result",))
    )
    assert outcome == "success" and userdata.result.position == 0.5
    cases = [
        (CallAction("hand", {"command": {"position": -1.0}}), "ended as ABORTED: fingers do not open that far"),
        (CallAction("hand", {"command": {"position": 0.5}}, {"stalled": True}), "stalled is False, expected True"),
        (CallAction("hand", {"force": 1}), "the values do not fit control_msgs/GripperCommandGoal"),
        (CallAction("hand", {"command": {"position": 2.0}}, timeout=0.3), "did not end within 0.3 s"),
        (CallAction("foot", server_timeout=0.3), "nobody offers it within 0.3 s"),
    ]
    for state, reason in cases:
        assert run(state)[0] == "fail"
        assert reason in state.reason, state.reason
    assert gripper.preempted.wait(30.0)
    values = {
        "outcome_field": "reached_goal",
        "outcomes": ("there", "short", "fail"),
        "input_keys": ("width",),
        "keep": {"at": "position"},
        "output_keys": ("at",),
        "outcome_values": {"there": True, "short": False},
    }
    state = CallAction("hand", {"command": {"position": "userdata.width"}}, **values)
    machine = smach.StateMachine(outcomes=["there", "short", "fail"])
    with machine:
        smach.StateMachine.add("ONLY", state)
    results = []
    for width in (0.5, -1.0):
        machine.userdata.width = width
        results.append((machine.execute(), machine.userdata.at))
    assert results == [("there", 0.5), ("short", 0.0)]
    assert (
        ended(
            CallAction(
                "hand",
                {"command": {"position": -1.0}},
                outcome_field="reached_goal",
                outcome_values={"there": False},
                outcomes=("there", "fail"),
            )
        )
        == "fail"
    )
    assert GoalStatus.ABORTED == 4


def test_what_managers_hold_is_stored_loaded_and_forgotten() -> None:
    add = rospy.ServiceProxy("add_joint_state", srv.AddJointState)
    add(JointState(name=["a"], position=[0.5]), "mine")
    assert run(Store("joint_state", "kept.yaml"))[0] == "success"
    assert run(ReinitialiseManagers(("joint_state",)))[0] == "success"
    assert names("joint_states") == ["up"]
    assert run(Load("joint_state", "kept.yaml"))[0] == "success"
    assert names("joint_states") == ["mine", "up"]
    assert run(ReinitialiseManagers())[0] == "success"
    for state, reason in (
        (Load("plan", "kept.yaml"), "contains messages of the kind 'joint state'"),
        (Store("pose", "poses.txt"), "a file that ends in .yaml"),
    ):
        assert run(state)[0] == "fail"
        assert reason in state.reason


def test_a_metric_is_published_and_must_be_a_number() -> None:
    heard: list[dict[str, object]] = []
    rospy.Subscriber("task_metrics", String, lambda message: heard.append(json.loads(message.data)))
    assert run(LogMetric("height", 0.25, unit="m"))[0] == "success"
    deadline = time.monotonic() + 60.0
    while not heard and time.monotonic() < deadline:
        time.sleep(0.02)
    assert (heard[0]["name"], heard[0]["value"], heard[0]["unit"]) == ("height", 0.25, "m")
    state = LogMetric("grip", from_key="force", input_keys=("force",))
    assert run(state, force=3)[0] == "success"
    assert run(state, force="much")[0] == "fail"
    assert "metric 'grip' is 'much'" in state.reason


def test_set_planner_changes_what_is_given_and_refuses_unknown_planners() -> None:
    calls: list[tuple[str, object]] = []

    def choose(name: str) -> None:
        if name not in ("RRTConnect", "pilz/LIN"):
            raise CommanderError(f"There is no planner '{name}'")
        calls.append(("id", name))

    commander = SimpleNamespace(
        set_planner_id=choose,
        set_planning_time=lambda value: calls.append(("time", value)),
        set_num_planning_attempts=lambda value: calls.append(("attempts", value)),
        set_max_velocity_scaling_factor=lambda value: calls.append(("speed", value)),
    )
    commander.of_group = lambda name: calls.append(("group", name)) or commander
    assert run(SetPlanner("pilz/LIN", speed_factor=0.1), arm_commander=commander)[0] == "success"
    assert run(SetPlanner("RRTConnect", group="hand"), arm_commander=commander)[0] == "success"
    assert calls == [("group", ""), ("id", "pilz/LIN"), ("speed", 0.1), ("group", "hand"), ("id", "RRTConnect")]
    state = SetPlanner("RRTConect")
    assert run(state, arm_commander=commander)[0] == "fail"
    assert "There is no planner 'RRTConect'" in state.reason


def test_objects_are_spawned_and_deleted_and_unknown_models_named(tmp_path) -> None:
    (tmp_path / "cube").mkdir()
    (tmp_path / "cube" / "model.sdf").write_text("<sdf/>")
    rospy.set_param("gazebo_model_path", str(tmp_path))
    models: dict[str, object] = {}

    def spawn(request):
        models[request.model_name] = request
        return SpawnModelResponse(True, "")

    services = [
        rospy.Service("gazebo/spawn_sdf_model", SpawnModel, spawn),
        rospy.Service(
            "gazebo/delete_model",
            DeleteModel,
            lambda request: DeleteModelResponse(models.pop(request.model_name, None) is not None, "no such model"),
        ),
    ]
    rospy.ServiceProxy("set_init_acm", srv.SetInitACM)(srv.SetInitACMRequest().acm)
    assert run(SpawnObject("cube", "mine", (0.1, 0.2, 0.3)))[0] == "success"
    assert models["mine"].initial_pose.position.y == 0.2
    for state, reason in (
        (SpawnObject("cube", "mine"), "an object 'mine' exists already"),
        (SpawnObject("sphere"), "the type must be a folder of"),
        (DeleteObject("other"), "no such model"),
    ):
        assert run(state)[0] == "fail"
        assert reason in state.reason, state.reason
    with pytest.raises(ValueError, match="option 'position' must be a list of 3 items, .* found a list of 2"):
        SpawnObject("cube", position=(0.0, 1.0))
    assert run(DeleteObject("mine"))[0] == "success"
    assert models == {}
    for service in services:
        service.shutdown()
