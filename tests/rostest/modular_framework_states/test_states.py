# SPDX-License-Identifier: BSD-3-Clause
"""The six states of a task: success is earned, failure has a reason, and a stop is obeyed."""

from __future__ import annotations

import re
import threading
import time
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix, RobotTrajectory
from moveit_msgs.srv import ApplyPlanningScene, ApplyPlanningSceneResponse
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger, TriggerResponse
from trajectory_msgs.msg import JointTrajectoryPoint

import smach
from modular_framework_core import srv
from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
from modular_framework_core.msg import GraspAction, GraspResult, StandardisedGrasp
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_states.states import wait_for_signal
from modular_framework_states.states.allow_manipulator_collisions import AllowManipulatorCollisions
from modular_framework_states.states.grasp import Grasp
from modular_framework_states.states.move import Move
from modular_framework_states.states.plan import Plan
from modular_framework_states.states.select import Select
from modular_framework_states.states.wait_for_signal import WaitForSignal


class FakeArm:
    """An arm with one joint whose angle equals the x of the tip; two solutions a turn apart for every pose."""

    def __init__(self) -> None:
        self.position = 0.0
        self.unreachable = float("inf")
        self.refuse_plan = ""
        self.stuck = False
        self.fault = ""
        self.slow = False
        self.moving = threading.Event()
        self.stopped = False
        self.plans: list[tuple[dict[str, float], dict[str, float] | None]] = []

    def positions_of(self, joints) -> dict[str, float]:
        return {name: value for name, value in self.current_joints().items() if name in joints}

    def of_group(self, name: str):
        self.groups = [*getattr(self, "groups", []), name]
        return self

    def current_joints(self) -> dict[str, float]:
        return {"j": self.position, "f": 1.9}

    def solve_ik(self, pose: PoseStamped, seed=None):
        x = pose.pose.position.x
        if x > self.unreachable:
            return Answer(False, joints={}, reason="the pose is out of reach")
        near = (seed or self.current_joints())["j"]
        return Answer(True, joints={"j": min((x, x + 6.0), key=lambda solution: abs(solution - near))}, reason="")

    def plan_to_joint_value_target(self, joints, custom_start_state=None):
        if self.refuse_plan:
            return SimpleNamespace(success=False, reason=self.refuse_plan)
        self.plans.append((dict(joints), custom_start_state))
        start = (custom_start_state or self.current_joints())["j"]
        return SimpleNamespace(success=True, reason="", trajectory=trajectory(start, joints["j"]))

    def execute_plan(self, plan, stop_requested=lambda: False):
        self.moving.set()
        while self.slow:
            if stop_requested():
                self.stopped = True
                return Answer(False, reason="stopped")
            time.sleep(0.01)
        if not self.stuck:
            self.position = plan.joint_trajectory.points[-1].positions[0]
        return Answer(not self.fault, reason=self.fault)


class Answer(SimpleNamespace):
    """Fields with a boolean value."""

    def __init__(self, value: bool, **fields: object) -> None:
        super().__init__(**fields)
        self._value = value

    def __bool__(self) -> bool:
        return self._value


def trajectory(*positions: float) -> RobotTrajectory:
    made = RobotTrajectory()
    made.joint_trajectory.joint_names = ["j"]
    made.joint_trajectory.points = [JointTrajectoryPoint(positions=[position]) for position in positions]
    return made


def grasp_message() -> StandardisedGrasp:
    poses = [generate_pose_stamped_message("world", (x, 0, 0), (0, 0, 0, 1)) for x in (2.9, 3.2, 3.4)]
    return get_standardised_grasp(["f"], [0.4], [1.9], [1.9], [1.0], *poses, 0.5, "g")


def run(state: smach.State, **userdata: object) -> tuple[str, smach.UserData]:
    machine = smach.StateMachine(outcomes=["success", "fail", "preempted"])
    for key, value in userdata.items():
        machine.userdata[key] = value
    with machine:
        smach.StateMachine.add("ONLY", state, transitions={})
    return machine.execute(), machine.userdata


def stop_when(begun: threading.Event, state: smach.State) -> None:
    """Asks a state to stop as soon as what it drives has begun, however long a busy machine takes until then."""

    def ask() -> None:
        assert begun.wait(60.0)
        state.request_preempt()

    threading.Thread(target=ask, daemon=True).start()


def call(name: str, service_type, **fields):
    proxy = rospy.ServiceProxy(name, service_type)
    proxy.wait_for_service(60)
    return proxy(**fields)


@pytest.fixture(scope="module", autouse=True)
def managers(ros_session):
    ros_session.wait_for_service("/get_object_type", 60)
    ros_session.wait_for_service("/get_modified_acm", 60)
    state = JointState(name=["j"], position=[1.0])
    call("add_joint_state", srv.AddJointState, joint_state=state, joint_state_name="one")
    call("add_grasp", srv.AddStandardisedGrasp, grasp_message=grasp_message(), grasp_name="g")
    return ros_session


@pytest.fixture
def arm() -> FakeArm:
    return FakeArm()


def stored_plan(name: str) -> RobotTrajectory:
    answer = call("get_plan", srv.GetMoveitPlan, plan_name=name)
    assert answer.success
    return answer.moveit_plan


# ---- WaitForSignal


def test_a_signal_sent_before_the_state_runs_is_not_lost() -> None:
    publisher = rospy.Publisher("early", Bool, queue_size=1, latch=True)
    publisher.publish(True)
    state = WaitForSignal("early", timeout=2.0)
    time.sleep(0.5)
    assert run(state)[0] == "success"
    started = time.monotonic()
    assert run(state)[0] == "fail", "a signal counts once"
    assert time.monotonic() - started >= 1.9


def test_a_latched_signal_of_an_earlier_task_counts_only_after_its_sender_has_renewed_it() -> None:
    publisher = rospy.Publisher("grasped/before", Bool, queue_size=1, latch=True)
    publisher.publish(True)
    answers = [TriggerResponse(True, "there are new ones"), TriggerResponse(False, "there are none left")]
    service = rospy.Service("grasped/before/renew", Trigger, lambda _: answers.pop(0))
    assert run(WaitForSignal("grasped/before", timeout=30.0))[0] == "success"
    state = WaitForSignal("grasped/before", timeout=30.0)
    assert run(state)[0] == "fail"
    assert "there are none left" in state.reason
    service.shutdown()


def test_a_false_signal_is_negative_and_its_reason_is_passed_on(monkeypatch) -> None:
    monkeypatch.setattr(wait_for_signal, "REASON_WAIT_S", 30.0)
    state = WaitForSignal("refused", timeout=30.0)
    rospy.Publisher("refused/reason", String, queue_size=1, latch=True).publish("nothing there")
    rospy.Publisher("refused", Bool, queue_size=1, latch=True).publish(False)
    assert run(state)[0] == "fail"
    assert "nothing there" in state.reason


def test_the_timeout_counts_from_when_a_node_that_starts_publishes_the_topic() -> None:
    state = WaitForSignal("late", timeout=1.0)
    outcomes: list[str] = []
    thread = threading.Thread(target=lambda: outcomes.append(run(state)[0]))
    thread.start()
    time.sleep(2.0)  # the node that starts takes longer than the timeout
    publisher = rospy.Publisher("late", Bool, queue_size=1, latch=True)
    publisher.publish(True)
    thread.join(30.0)
    assert outcomes == ["success"]


def test_waiting_ends_at_the_timeout_or_when_stopped() -> None:
    rospy.set_param("/start_timeout", 0.3)
    state = WaitForSignal("nowhere", timeout=0.2)
    assert run(state)[0] == "fail"
    assert "no node publishes topic '/nowhere' after 0.3 s" in state.reason
    rospy.delete_param("/start_timeout")
    publisher = rospy.Publisher("silent", Bool, queue_size=1)
    state = WaitForSignal("silent", timeout=0.2)
    assert run(state)[0] == "fail"
    assert "no signal came on topic '/silent'" in state.reason
    publisher.unregister()
    endless = WaitForSignal("silent", outcomes=("success", "preempted", "fail"))
    threading.Timer(0.3, endless.request_preempt).start()
    assert run(endless)[0] == "preempted"


def test_a_timeout_that_is_not_positive_is_refused() -> None:
    with pytest.raises(ValueError, match="timeout"):
        WaitForSignal("x", timeout=0)


# ---- Select


def test_names_are_taken_one_after_the_other_and_again_after_the_last() -> None:
    state = Select("grasp", ["g", "g"], output_keys=["selected_grasp"])
    outcomes = [run(state)[0] for _ in range(5)]
    assert outcomes == ["success", "success", "fail", "success", "success"]
    assert run(Select("pregrasp", ["g"], output_keys=["selected_grasp"]))[1].selected_grasp.grasp_id == "g"


def test_a_missing_output_key_fails_and_keeps_the_message() -> None:
    call("add_grasp", srv.AddStandardisedGrasp, grasp_message=StandardisedGrasp(grasp_id="kept"), grasp_name="")
    state = Select("grasp")
    assert run(state)[0] == "fail"
    assert "selected_grasp" in state.reason
    outcome, userdata = run(Select("grasp", output_keys=["selected_grasp"]))
    assert outcome == "success"
    assert userdata.selected_grasp.grasp_id == "kept"
    assert run(Select("grasp", output_keys=["selected_grasp"]))[0] == "fail"


@pytest.mark.parametrize(
    ("message_type", "key"),
    [("joint_state", "selected_joint_state"), ("pose", "selected_pose"), ("plan", "selected_plan")],
)
def test_every_type_goes_to_its_own_key(message_type: str, key: str) -> None:
    call("add_pose", srv.AddPoseStamped, pose_stamped=PoseStamped(), pose_name="one")
    call("add_plan", srv.AddMoveitPlan, moveit_plan=trajectory(0.0), plan_name="one")
    outcome, userdata = run(Select(message_type, "one", output_keys=[key]))
    assert outcome == "success"
    assert userdata[key] is not None


def test_unknown_words_are_refused_when_a_state_is_made() -> None:
    for make in (
        lambda: Select("cup"),
        lambda: Plan("cup"),
        lambda: Plan("pose", starting_state_type="cup"),
        lambda: Grasp("cup"),
        lambda: AllowManipulatorCollisions(True, "cup"),
        lambda: AllowManipulatorCollisions(True, "", links=["cup"]),
    ):
        with pytest.raises(ValueError, match="cup|links needs a collision_type"):
            make()


# ---- Plan


def test_a_plan_to_a_joint_state_is_stored_under_its_name(arm: FakeArm) -> None:
    assert run(Plan("joint_state", "one", "to_one"), arm_commander=arm)[0] == "success"
    assert [point.positions[0] for point in stored_plan("to_one").joint_trajectory.points] == [0.0, 1.0]


def test_a_pose_goes_through_inverse_kinematics_near_the_start(arm: FakeArm) -> None:
    pose = generate_pose_stamped_message("world", (0.5, 0, 0), (0, 0, 0, 1))
    call("add_pose", srv.AddPoseStamped, pose_stamped=pose, pose_name="place")
    arm.position = 5.9
    assert run(Plan("pose", "place", "to_place"), arm_commander=arm)[0] == "success"
    assert stored_plan("to_place").joint_trajectory.points[-1].positions[0] == pytest.approx(6.5)


def test_plans_made_at_the_same_time_fit_end_to_start(arm: FakeArm) -> None:
    arm.position = 0.1
    keys = {"input_keys": ["selected_grasp"]}
    plans = smach.Concurrence(
        outcomes=["success", "fail"],
        default_outcome="fail",
        input_keys=["selected_grasp"],
        outcome_map={"success": {"A": "success", "B": "success", "C": "success"}},
    )
    plans.register_io_keys(["arm_commander"])
    with plans:
        smach.Concurrence.add("A", Plan("pregrasp", "userdata", "a", **keys))
        smach.Concurrence.add("B", Plan("grasp", "userdata", "b", "pregrasp", "userdata", **keys))
        smach.Concurrence.add("C", Plan("joint_state", "one", "c", "grasp", "userdata", **keys))
    assert run(plans, arm_commander=arm, selected_grasp=grasp_message())[0] == "success"
    a, b, c = (stored_plan(name).joint_trajectory.points for name in "abc")
    assert a[-1].positions == b[0].positions
    assert b[-1].positions == c[0].positions
    starts = [start for _, start in arm.plans if start is not None]
    assert all(start["f"] == 0.4 for start in starts)


@pytest.mark.parametrize(
    ("change", "hint"),
    [
        ({"unreachable": 0.5}, "pregrasp pose of grasp 'g'.*out of reach"),
        ({"refuse_plan": "GOAL_IN_COLLISION"}, "GOAL_IN_COLLISION"),
    ],
)
def test_what_cannot_be_planned_fails_with_the_reason(arm: FakeArm, change: dict, hint: str) -> None:
    vars(arm).update(change)
    state = Plan("pregrasp", "userdata", "none", input_keys=["selected_grasp"])
    assert run(state, arm_commander=arm, selected_grasp=grasp_message())[0] == "fail"
    assert re.search(hint, state.reason)


def test_missing_messages_fail_with_the_reason(arm: FakeArm) -> None:
    for state, hint in (
        (Plan("joint_state", "nobody"), "nobody"),
        (Plan("grasp", "userdata"), "input keys"),
        (Plan("grasp", "userdata", input_keys=["selected_grasp"]), "is empty"),
    ):
        assert run(state, arm_commander=arm, selected_grasp=None)[0] == "fail"
        assert hint in state.reason


# ---- Move


def add_plan(name: str, *positions: float) -> None:
    call("add_plan", srv.AddMoveitPlan, moveit_plan=trajectory(*positions), plan_name=name)


def test_a_motion_counts_only_when_the_arm_arrives(arm: FakeArm) -> None:
    add_plan("go", 0.0, 1.0)
    assert run(Move("go"), arm_commander=arm)[0] == "success"
    arm.position, arm.stuck = 0.0, True
    state = Move("go")
    assert run(state, arm_commander=arm)[0] == "fail"
    assert "'j' is 1.0" in state.reason


def test_a_motion_that_reports_failure_fails_with_its_reason(arm: FakeArm) -> None:
    add_plan("go", 0.0, 1.0)
    arm.fault = "CONTROL_FAILED"
    state = Move("go")
    assert run(state, arm_commander=arm)[0] == "fail"
    assert "CONTROL_FAILED" in state.reason


def test_a_plan_that_starts_elsewhere_is_not_executed(arm: FakeArm) -> None:
    arm.position = 0.3
    state = Move(input_keys=["selected_plan"])
    assert run(state, arm_commander=arm, selected_plan=trajectory(0.0, 1.0))[0] == "fail"
    assert "'j' is 0.3" in state.reason
    assert arm.position == 0.3


def test_a_stop_ends_the_motion(arm: FakeArm) -> None:
    arm.slow = True
    state = Move(input_keys=["selected_plan"], outcomes=("success", "preempted", "fail"))
    stop_when(arm.moving, state)
    assert run(state, arm_commander=arm, selected_plan=trajectory(0.0, 1.0))[0] == "preempted"
    assert arm.stopped


def test_a_missing_or_empty_plan_fails(arm: FakeArm) -> None:
    add_plan("empty")
    for state in (Move("nobody"), Move("empty"), Move(input_keys=["selected_plan"])):
        assert run(state, arm_commander=arm, selected_plan=None)[0] == "fail"
        assert state.reason


# ---- Grasp


@pytest.fixture(scope="module")
def hand():
    fake = SimpleNamespace(
        flags=(True, True, True), succeed=True, wait=False, moving=threading.Event(), stopped=threading.Event()
    )

    def on_goal(goal):
        fake.moving.set()
        while fake.wait and not server.is_preempt_requested():
            time.sleep(0.01)
        if server.is_preempt_requested():
            fake.stopped.set()
            server.set_preempted()
            return
        result = GraspResult(*(Bool(flag) for flag in fake.flags))
        (server.set_succeeded if fake.succeed else server.set_aborted)(result, "said so")

    server = actionlib.SimpleActionServer("hand", GraspAction, on_goal, False)
    server.start()
    fake.client = SteadyActionClient("hand", GraspAction)
    return fake


@pytest.mark.parametrize(
    ("grasp_type", "flags", "succeed", "outcome"),
    [
        ("pregrasp", (True, False, False), True, "success"),
        ("grasp", (False, True, False), True, "success"),
        ("postgrasp", (False, False, True), True, "success"),
        ("grasp", (True, False, True), True, "fail"),
        ("grasp", (False, True, False), False, "fail"),
    ],
)
def test_the_flag_of_the_stage_and_the_status_decide(hand, grasp_type, flags, succeed, outcome) -> None:
    hand.flags, hand.succeed = flags, succeed
    state = Grasp(grasp_type, "g")
    assert run(state, manipulator_controller_client=hand.client, max_torque=400)[0] == outcome
    assert ("said so" in state.reason) == (outcome == "fail")


def test_a_stop_cancels_the_hand(hand) -> None:
    hand.wait = True
    hand.moving.clear()
    state = Grasp("grasp", "g", outcomes=("success", "preempted", "fail"))
    stop_when(hand.moving, state)
    assert run(state, manipulator_controller_client=hand.client, max_torque=400)[0] == "preempted"
    assert hand.stopped.wait(30.0)
    hand.wait = False


def test_a_hand_that_does_not_answer_in_time_is_a_failure(hand) -> None:
    hand.wait = True
    state = Grasp("grasp", "g", timeout=0.3)
    assert run(state, manipulator_controller_client=hand.client, max_torque=400)[0] == "fail"
    hand.wait = False
    assert run(Grasp("grasp", "g"), manipulator_controller_client=None, max_torque=400)[0] == "fail"


# ---- AllowManipulatorCollisions


def test_collisions_are_allowed_only_when_the_scene_takes_them() -> None:
    scenes = []
    answer = ApplyPlanningSceneResponse(success=True)
    service = rospy.Service(
        "apply_planning_scene", ApplyPlanningScene, lambda request: scenes.append(request.scene) or answer
    )
    state = AllowManipulatorCollisions(True, "object-collision")
    assert run(state)[0] == "fail"
    assert "get_modified_acm" in state.reason
    rows = [AllowedCollisionEntry(enabled=[False, False]) for _ in range(2)]
    call("set_init_acm", srv.SetInitACM, acm=AllowedCollisionMatrix(entry_names=["arm", "palm"], entry_values=rows))
    call("update_acm_entry", srv.UpdateACMEntry, action=0, entry_name="box")
    assert run(state)[0] == "success"
    assert scenes[-1].is_diff
    assert scenes[-1].robot_state.is_diff
    matrix = scenes[-1].allowed_collision_matrix
    assert matrix.entry_values[matrix.entry_names.index("palm")].enabled[matrix.entry_names.index("box__link")]
    answer.success = False
    assert run(state)[0] == "fail"
    assert "apply_planning_scene" in state.reason
    service.shutdown()


def test_any_links_may_touch_objects_and_the_scene_hears_at_once_when_a_permission_ends() -> None:
    scenes = []
    service = rospy.Service(
        "apply_planning_scene",
        ApplyPlanningScene,
        lambda request: scenes.append(request.scene) or ApplyPlanningSceneResponse(success=True),
    )
    rows = [AllowedCollisionEntry(enabled=[False, False]) for _ in range(2)]
    call("set_init_acm", srv.SetInitACM, acm=AllowedCollisionMatrix(entry_names=["arm", "palm"], entry_values=rows))
    call("update_acm_entry", srv.UpdateACMEntry, action=0, entry_name="crate")

    def touching() -> set[str]:
        matrix = scenes[-1].allowed_collision_matrix
        row = matrix.entry_values[matrix.entry_names.index("crate__link")].enabled
        return {name for name, allowed in zip(matrix.entry_names, row, strict=True) if allowed} - {"crate__link"}

    assert run(AllowManipulatorCollisions(True, "object-collision", ["crate"], links=["arm"]))[0] == "success"
    assert touching() == {"arm"}
    unknown = AllowManipulatorCollisions(True, "object-collision", ["crate"], links=["army"])
    assert run(unknown)[0] == "fail" and "modify_acm" in unknown.reason
    seen = len(scenes)
    call("update_acm_entry", srv.UpdateACMEntry, action=2, entry_name="")
    assert len(scenes) == seen + 1 and touching() == set()
    call("modify_acm", srv.ModifyACM, modification=0, robot_links=["arm", "palm"], allow_collision=True, publish=True)
    matrix = scenes[-1].allowed_collision_matrix
    assert matrix.entry_values[0].enabled[:2] == [False, True]
    call("update_acm_entry", srv.UpdateACMEntry, action=1, entry_name="crate")
    service.shutdown()


def test_the_object_of_the_selected_grasp_is_the_only_one_that_may_be_touched() -> None:
    scenes = []
    service = rospy.Service(
        "apply_planning_scene",
        ApplyPlanningScene,
        lambda request: scenes.append(request.scene) or ApplyPlanningSceneResponse(success=True),
    )
    rows = [AllowedCollisionEntry(enabled=[False, False]) for _ in range(2)]
    call("set_init_acm", srv.SetInitACM, acm=AllowedCollisionMatrix(entry_names=["arm", "palm"], entry_values=rows))
    for name in ("held", "beside"):
        call("update_acm_entry", srv.UpdateACMEntry, action=0, entry_name=name)
    grasp = grasp_message()
    grasp.object_id = "held__link"
    state = AllowManipulatorCollisions(True, "object-collision", "userdata", input_keys=["selected_grasp"])
    assert run(state, selected_grasp=grasp)[0] == "success"
    matrix = scenes[-1].allowed_collision_matrix
    palm = matrix.entry_values[matrix.entry_names.index("palm")].enabled
    assert palm[matrix.entry_names.index("held__link")]
    assert not palm[matrix.entry_names.index("beside__link")]
    for nothing in (None, grasp_message()):
        assert run(state, selected_grasp=nothing)[0] == "fail"
        assert "names no object" in state.reason
    unkeyed = AllowManipulatorCollisions(True, "object-collision", "userdata")
    assert run(unkeyed, selected_grasp=grasp)[0] == "fail"
    assert "input keys" in unkeyed.reason
    service.shutdown()
