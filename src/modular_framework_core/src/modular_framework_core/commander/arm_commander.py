# SPDX-License-Identifier: BSD-3-Clause
"""Plans and executes arm motions through move_group.

Several states may share one commander: every call has its own start state and target, and only the planner settings
persist between calls.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Iterable, Mapping

import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import (
    Constraints,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryGoal,
    MoveItErrorCodes,
    RobotTrajectory,
)
from moveit_msgs.srv import (
    GetMotionPlan,
    GetMotionPlanRequest,
    GetPositionIK,
    GetPositionIKRequest,
    GetStateValidity,
    GetStateValidityRequest,
)
from sensor_msgs.msg import JointState

from modular_framework_core.commander.moveit_requests import (
    JOINT_TOLERANCE_RAD,
    StartState,
    describe_pose,
    error_name,
    joints_of,
    pose_goal,
    robot_state,
)
from modular_framework_core.commander.results import ExecutionResult, IkResult, PlanResult
from modular_framework_core.commander.robot_groups import Group, RobotModelError, read_group
from modular_framework_core.commander.ros_joint_monitor import JointMonitor
from modular_framework_core.commander.ros_planner_names import planners_by_pipeline
from modular_framework_core.commander.ros_planning_reports import PlanningReports
from modular_framework_core.task_constructor.known_names import PlannerNames
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.calls import (
    CallError,
    call_service,
    wait_for_action,
    wait_for_result,
    wait_for_service,
    wait_until,
)
from modular_framework_ros.connections.ros_frozen_nodes import frozen_nodes
from modular_framework_ros.messages.ros_goal_constraints import joint_goal
from modular_framework_ros.seeds import seed_parameter
from modular_framework_ros.start_up import start_timeout, wait_for_start
from modular_framework_ros.stop_requests import stop_requested

EXECUTE_ACTION = "execute_trajectory"
CLOCK_WAIT_S = 0.3
SERVICE_TIMEOUT_S = 10.0
IK_TIMEOUT_S = 1.0
SEEDED_TIMEOUT_FACTOR = 10.0


class CommanderError(RuntimeError):
    """The commander cannot be used."""


class ArmCommander:
    """Thread-safe client of move_group for one planning group.

    Parameters: ``robot_description``, ``robot_description_semantic``, ``robot_description_planning/joint_limits``.
    Subscribers: see :class:`JointMonitor` and :class:`PlanningReports`.
    Services called: ``plan_kinematic_path``, ``compute_ik``, ``check_state_validity``, ``query_planner_interface``.
    Actions called: ``execute_trajectory``.

    Args:
        name: Planning group.
        set_ground: Compatibility argument, which must be False; the planning scene contains the ground.

    Raises:
        CommanderError: ``set_ground`` is True.
    """

    def __init__(self, name: str, set_ground: bool = False) -> None:
        if set_ground:
            raise CommanderError("set_ground=True is not supported; put the ground into the scene or the world file.")
        self.group_name = name
        self._velocity_scaling = 1.0
        self._pipeline_id = self._planner_id = ""
        self._attempts = 1
        self._planning_time_s = 5.0
        self._connect_lock = threading.Lock()
        self._execute_lock = threading.Lock()
        self._stop_event = threading.Event()
        self._group: Group | None = None
        self._joints = JointMonitor()
        self._reports = PlanningReports()
        self._other_commanders: dict[str, ArmCommander] = {}
        self._other_commanders_lock = threading.Lock()

    def connect(self, timeout_s: float | None = None) -> None:
        """Reads the robot model and waits for move_group. Repeated calls have no effect.

        Args:
            timeout_s: Timeout of each wait [s]; None for the parameter ``/start_timeout``.

        Raises:
            CommanderError: A parameter, service, action or joint is missing; the message names it.
        """
        with self._connect_lock:
            if self._group is not None:
                return
            limit_s = start_timeout() if timeout_s is None else timeout_s
            self._plan_service = rospy.ServiceProxy("plan_kinematic_path", GetMotionPlan)
            self._ik_service = rospy.ServiceProxy("compute_ik", GetPositionIK)
            self._execute_client = SteadyActionClient(EXECUTE_ACTION, ExecuteTrajectoryAction)
            self._joints.connect()
            self._reports.connect()
            try:
                group = self._read_group()
                for proxy in (self._plan_service, self._ik_service):
                    wait_for_service(proxy, limit_s)
                wait_for_action(self._execute_client, EXECUTE_ACTION, limit_s)
            except (CallError, RobotModelError) as error:
                raise CommanderError(f"Arm commander of group '{self.group_name}': {error}") from error
            topic = rospy.resolve_name("joint_states")
            if not wait_for_start(
                lambda: not self._missing_joints(group),
                lambda: f"the joints {list(self._missing_joints(group))} on topic '{topic}'",
                limit_s,
            ):
                raise CommanderError(
                    f"Arm commander of group '{self.group_name}': topic '{topic}' did not deliver the "
                    f"joints {list(self._missing_joints(group))} within {limit_s:.1f} s; start the "
                    "joint state controller."
                )
            self._group = group

    @property
    def group(self) -> Group:
        """Planning group; connects on first use."""
        self.connect()
        if self._group is None:
            raise CommanderError(f"Arm commander of group '{self.group_name}' is not connected.")
        return self._group

    def of_group(self, name: str) -> ArmCommander:
        """Returns the commander of a different planning group.

        On first use, the new commander copies the settings of this commander; later changes are independent.

        Args:
            name: Planning group; "" for this commander.

        Raises:
            CommanderError: The group is unknown, or the commander cannot connect.
        """
        if not name or name == self.group_name:
            return self
        with self._other_commanders_lock:
            other = self._other_commanders.get(name)
            if other is None:
                other = ArmCommander(name)
                other._velocity_scaling, other._attempts = self._velocity_scaling, self._attempts
                other._pipeline_id, other._planner_id = self._pipeline_id, self._planner_id
                other._planning_time_s = self._planning_time_s
                other.connect()
                self._other_commanders[name] = other
        return other

    def set_max_velocity_scaling_factor(self, factor: float) -> None:
        """Sets the scaling factor of the joints' velocity and acceleration limits, in (0, 1].

        Raises:
            CommanderError: The factor is out of range.
        """
        if not 0.0 < float(factor) <= 1.0:
            raise CommanderError(f"The velocity scaling factor is {factor}; it must be above 0 and at most 1.")
        self._velocity_scaling = float(factor)

    def set_planner_id(self, planner_id: str) -> None:
        """Sets the planner as ``planner`` or ``pipeline/planner``; "" for the default.

        Without pipeline, the pipeline is set if exactly one pipeline has the planner.

        Raises:
            CommanderError: The planner or pipeline is unknown, or move_group does not answer.
        """
        pipeline, _, planner = str(planner_id).rpartition("/")
        available = self._planners() if planner_id else {}
        if pipeline and pipeline not in available:
            known_planners = listing(sorted(available))
            raise CommanderError(f"There is no pipeline '{pipeline}'; {known_planners}{nearest(pipeline, available)}")
        matches = [name for name, planners in available.items() if planner in planners or (pipeline and not planners)]
        if planner_id and not (pipeline in matches if pipeline else matches):
            names = self.planner_names()
            raise CommanderError(
                f"There is no planner '{planner_id}'; {listing(names)}{nearest(str(planner_id), names)}"
            )
        self._pipeline_id = pipeline or (matches[0] if len(matches) == 1 else "")
        self._planner_id = planner

    def planner_names(self) -> list[str]:
        """Returns the available planners, each as ``planner`` and as ``pipeline/planner``.

        Raises:
            CommanderError: move_group does not answer.
        """
        return sorted(PlannerNames(self._planners()))

    def _planners(self) -> dict[str, set[str]]:
        """Returns the planners available to this group, by pipeline."""
        try:
            return planners_by_pipeline(group=self.group_name)
        except CallError as error:
            raise CommanderError(str(error)) from error

    def set_num_planning_attempts(self, attempts: int) -> None:
        """Sets the number of planning attempts.

        Raises:
            CommanderError: The number is below 1.
        """
        if int(attempts) < 1:
            raise CommanderError(f"The number of planning attempts is {attempts}; it must be 1 or more.")
        self._attempts = int(attempts)

    def set_planning_time(self, seconds: float) -> None:
        """Sets the planning time [s].

        Raises:
            CommanderError: The time is not positive.
        """
        if not float(seconds) > 0.0:
            raise CommanderError(f"The planning time is {seconds} s; it must be more than 0.")
        self._planning_time_s = float(seconds)

    def current_joints(self) -> dict[str, float]:
        """Returns the latest positions of the group's joints [rad or m].

        Joints outside of the group are omitted, because a seed with mimic joints would fix their positions.
        """
        names = self.group.joint_names
        self._joints.catch_up()
        return self._joints.positions(names)

    def positions_of(self, joints: Iterable[str]) -> dict[str, float]:
        """Returns the latest positions of joints [rad or m]. Joints without a received position are omitted."""
        self._joints.catch_up()
        return self._joints.positions(joints)

    def plan_to_pose_target(self, pose: PoseStamped, custom_start_state: StartState = None) -> PlanResult:
        """Plans to a pose of the group's tip link.

        Args:
            pose: Target pose of the tip link.
            custom_start_state: Start state; None for the current state.

        Returns:
            The plan, or the reason of the failure.
        """
        if self._tip_fault():
            return _no_plan(MoveItErrorCodes.INVALID_GROUP_NAME, self._tip_fault())
        return self._plan(lambda name: pose_goal(pose, self.group.tip_link, name), custom_start_state)

    def plan_to_joint_value_target(
        self, joints: Mapping[str, float] | JointState, custom_start_state: StartState = None
    ) -> PlanResult:
        """Plans to joint positions.

        Args:
            joints: Target {joint: position} [rad or m]. Joints outside of the group are ignored.
            custom_start_state: Start state; None for the current state.

        Returns:
            The plan, or the reason of the failure.
        """
        values = dict(zip(joints.name, joints.position, strict=False)) if isinstance(joints, JointState) else joints
        target = {name: values[name] for name in self.group.joint_names if name in values}
        if not target:
            return _no_plan(
                MoveItErrorCodes.INVALID_GOAL_CONSTRAINTS,
                f"the target names the joints {sorted(values)}, group '{self.group_name}' has "
                f"{list(self.group.joint_names)}; name joints of the group",
            )
        return self._plan(lambda name: joint_goal(target, JOINT_TOLERANCE_RAD, name), custom_start_state)

    def get_ik(self, pose: PoseStamped, seed: StartState = None) -> dict[str, float] | None:
        """Returns joint positions [rad or m] for a pose of the tip link, or None without a solution."""
        return self.solve_ik(pose, seed).joints or None

    def solve_ik(self, pose: PoseStamped, seed: StartState = None) -> IkResult:
        """Solves the collision-free inverse kinematics of the tip link.

        Args:
            pose: Target pose of the tip link.
            seed: Seed state, which also sets the joints outside of the group; None for the current state.

        Returns:
            The solution nearest to the seed, or the reason of the failure.
        """
        if self._tip_fault():
            return IkResult({}, MoveItErrorCodes.INVALID_GROUP_NAME, self._tip_fault())
        try:
            result = self._ik(pose, seed, avoid_collisions=True)
            if result:
                return result
            in_collision = self._ik(pose, seed, avoid_collisions=False)
            prefix = f"link '{self.group.tip_link}' cannot reach {describe_pose(pose)}: "
            if in_collision:
                return IkResult(
                    {}, result.error_code, prefix + (self.contacts(in_collision.joints, seed) or result.reason)
                )
            return IkResult({}, result.error_code, prefix + f"the pose is out of reach ({result.reason})")
        except CallError as error:
            return IkResult({}, MoveItErrorCodes.COMMUNICATION_FAILURE, str(error))

    def contacts(self, joints: Mapping[str, float], start: StartState = None) -> str:
        """Returns the collisions at given joint positions, as text.

        Args:
            joints: {joint: position} [rad or m].
            start: State of all other joints; None for the current state.

        Returns:
            The colliding pairs; "" if the state is valid.

        Raises:
            CallError: move_group does not answer.
        """
        request = GetStateValidityRequest(group_name=self.group_name)
        state = robot_state(start)
        merged = dict(zip(state.joint_state.name, state.joint_state.position, strict=False)) | dict(joints)
        state.joint_state = JointState(name=list(merged), position=list(merged.values()))
        request.robot_state = state
        proxy = rospy.ServiceProxy("check_state_validity", GetStateValidity)
        response = call_service(proxy, request, SERVICE_TIMEOUT_S)
        if response.valid:
            return ""
        pairs = sorted({f"'{contact.contact_body_1}' with '{contact.contact_body_2}'" for contact in response.contacts})
        return f"in collision there ({', '.join(pairs[:3]) or 'no contact was reported'})"

    def execute_plan(
        self, plan: RobotTrajectory | PlanResult, stop_requested: Callable[[], bool] = stop_requested
    ) -> ExecutionResult:
        """Executes a plan and waits for the end of the motion.

        Args:
            plan: Plan or trajectory to execute.
            stop_requested: Function polled during the motion; True stops the motion.

        Returns:
            Success, or the reason of the failure.
        """
        trajectory = plan.trajectory if isinstance(plan, PlanResult) else plan
        points = trajectory.joint_trajectory.points
        if not points:
            return ExecutionResult(False, MoveItErrorCodes.INVALID_MOTION_PLAN, "the plan has no point")
        self.connect()
        timeout_s = 60.0 + 10.0 * points[-1].time_from_start.to_sec()
        with self._execute_lock:
            self._stop_event.clear()
            try:
                wait_for_action(self._execute_client, EXECUTE_ACTION, SERVICE_TIMEOUT_S)
            except CallError as error:
                return ExecutionResult(False, MoveItErrorCodes.COMMUNICATION_FAILURE, str(error))
            self._execute_client.send_goal(ExecuteTrajectoryGoal(trajectory=trajectory))
            status = wait_for_result(
                self._execute_client, timeout_s, lambda: self._stop_event.is_set() or stop_requested()
            )
            return self._execution_result(status, timeout_s)

    def stop(self) -> None:
        """Stops the current motion, if any."""
        self._stop_event.set()

    def _execution_result(self, status: int, timeout_s: float) -> ExecutionResult:
        if status == GoalStatus.PREEMPTED:
            return ExecutionResult(False, MoveItErrorCodes.PREEMPTED, "the motion was stopped on request")
        if status == GoalStatus.LOST:
            frozen = frozen_nodes()
            reason = f"action '{rospy.resolve_name(EXECUTE_ACTION)}' did not end " + (
                frozen or f"within {timeout_s:.1f} s"
            )
            now_s = rospy.get_time()
            if not wait_until(lambda: rospy.get_time() != now_s, CLOCK_WAIT_S):
                reason += f": simulated time stands still at {now_s:.3f} s; is the simulation paused?"
            return ExecutionResult(False, MoveItErrorCodes.TIMED_OUT, reason)
        result = self._execute_client.get_result()
        code = result.error_code.val if result is not None else MoveItErrorCodes.FAILURE
        if status == GoalStatus.SUCCEEDED and code == MoveItErrorCodes.SUCCESS:
            return ExecutionResult(True)
        text = self._execute_client.get_goal_status_text()
        return ExecutionResult(False, code, f"{error_name(code)}{': ' + text if text else ''}")

    def _plan(self, goal: Callable[[str], Constraints], start: StartState) -> PlanResult:
        name = f"plan_{uuid.uuid4().hex}"
        self.connect()
        request = GetMotionPlanRequest()
        message = request.motion_plan_request
        message.group_name = self.group_name
        message.pipeline_id, message.planner_id = self._pipeline_id, self._planner_id
        message.num_planning_attempts = self._attempts
        message.allowed_planning_time = self._planning_time_s
        message.max_velocity_scaling_factor = message.max_acceleration_scaling_factor = self._velocity_scaling
        message.start_state = robot_state(start)
        message.goal_constraints = [goal(name)]
        timeout_s = SERVICE_TIMEOUT_S + 3.0 * self._attempts * self._planning_time_s
        if (
            seed_parameter() is not None
        ):  # seeded searches are bounded by iterations, which take longer on slow machines
            timeout_s *= SEEDED_TIMEOUT_FACTOR
        try:
            proxy = rospy.ServiceProxy("plan_kinematic_path", GetMotionPlan)
            response = call_service(proxy, request, timeout_s).motion_plan_response
        except CallError as error:
            return _no_plan(MoveItErrorCodes.COMMUNICATION_FAILURE, str(error))
        code = response.error_code.val
        if code == MoveItErrorCodes.SUCCESS and response.trajectory.joint_trajectory.points:
            return PlanResult(response.trajectory, True, code, "")
        reason = self._reports.reason_of(name)
        return _no_plan(code, f"{error_name(code)}: {reason}" if reason else error_name(code))

    def _ik(self, pose: PoseStamped, seed: StartState, avoid_collisions: bool) -> IkResult:
        group = self.group
        request = GetPositionIKRequest()
        message = request.ik_request
        message.group_name, message.ik_link_name = group.name, group.tip_link
        message.robot_state, message.pose_stamped = robot_state(seed), pose
        message.avoid_collisions = avoid_collisions
        message.timeout = rospy.Duration.from_sec(IK_TIMEOUT_S)
        proxy = rospy.ServiceProxy("compute_ik", GetPositionIK)
        response = call_service(proxy, request, SERVICE_TIMEOUT_S + IK_TIMEOUT_S)
        code = response.error_code.val
        if code != MoveItErrorCodes.SUCCESS:
            return IkResult({}, code, error_name(code))
        joints = joints_of(response.solution.joint_state, group.joint_names)
        missing = sorted(set(group.joint_names) - set(joints))
        if missing:
            return IkResult({}, MoveItErrorCodes.FAILURE, f"the solution of compute_ik lacks the joints {missing}")
        return IkResult(joints, code, "")

    def _read_group(self) -> Group:
        urdf, srdf = rospy.get_param("robot_description", ""), rospy.get_param("robot_description_semantic", "")
        for name, text in (("robot_description", urdf), ("robot_description_semantic", srdf)):
            if not text:
                raise RobotModelError(f"parameter '{rospy.resolve_name(name)}' is not set; load the robot first")
        limits = rospy.get_param("robot_description_planning/joint_limits", {})
        group = read_group(str(urdf), str(srdf), self.group_name, limits if isinstance(limits, dict) else {})
        if not group.joints:
            raise RobotModelError(f"group '{self.group_name}' has no active joint; choose one that has")
        return group

    def _tip_fault(self) -> str:
        """Returns the fault of a pose target for a group without a tip link; "" for a group with a tip link."""
        return (
            ""
            if self.group.tip_link
            else (
                f"group '{self.group_name}' is not a chain and has no tip link for a pose; "
                "choose a group that is a chain, or a joint target"
            )
        )

    def _missing_joints(self, group: Group) -> tuple[str, ...]:
        received = self._joints.positions(group.joint_names)
        return tuple(name for name in group.joint_names if name not in received)


def _no_plan(code: int, reason: str) -> PlanResult:
    return PlanResult(RobotTrajectory(), False, code, reason)
