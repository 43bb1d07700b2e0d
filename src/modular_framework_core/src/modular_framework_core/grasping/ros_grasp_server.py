# SPDX-License-Identifier: BSD-3-Clause
"""Server of the Grasp action: moves the manipulator to the stages of a grasp and reports the result."""

from __future__ import annotations

import threading
from contextlib import suppress
from typing import Any

import rospy

from modular_framework_core.commander.robot_groups import Group, RobotModelError, read_group
from modular_framework_core.grasping.grasp_server import (
    GraspCommandError,
    Outcome,
    Stage,
    Verdict,
    closed_positions,
    effort_limits,
    judge,
    posture_targets,
    reached_tolerance,
    torque_intensities,
    torque_share,
)
from modular_framework_core.grasping.ros_manipulator_drivers import ControlledManipulator, Manipulator, Motion
from modular_framework_core.grasping.stall_evidence import CommandedMotion, StallEvidence
from modular_framework_core.msg import GraspAction, GraspCommand, GraspFeedback, GraspResult
from modular_framework_ros.action_server import SteadyActionServer
from modular_framework_ros.calls import CallError
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.running_goals import RunningGoals
from modular_framework_ros.start_up import start_timeout, wait_for_start

FEEDBACK_PERIOD_S = 0.1
STAGE_FIELDS = {
    Stage.PREGRASP: ("pregrasp", "pregrasped"),
    Stage.GRASP: ("grasp", "grasped"),
    Stage.POSTGRASP: ("postgrasp", "postgrasped"),
}


class GraspServer:
    """Action server of modular_framework_core/Grasp. A new goal replaces the current goal; a cancel stops the fingers.

    The server moves the fingers to ``posture`` of the commanded stage. It ignores ``pose``, which is a target of the
    arm.

    Parameters: see ``parameters/grasp_server.yaml``.

    Args:
        group: Planning group of the fingers.
        manipulator: Driver of the fingers.
    """

    def __init__(self, group: Group, manipulator: Manipulator) -> None:
        self._group, self._manipulator = group, manipulator
        read = DeclaredParameters("modular_framework_core", "grasp_server").values
        self._full_scale, tolerance, self._timeout_s = read(
            "~max_torque_full_scale", "~position_tolerance", "~motion_timeout"
        )
        self._tolerance = tolerance or reached_tolerance(group)
        self._motion_lock = threading.Lock()
        self._goals = RunningGoals()
        self._evidence = StallEvidence(self._tolerance)
        self._last_s = 0.0

    def connect(self, action_name: str) -> None:
        """Connects the manipulator and starts the action server."""
        self._manipulator.connect()
        self._server = SteadyActionServer(action_name, GraspAction, self._on_goal, self._goals.cancel, auto_start=False)
        self._server.start()

    def _on_goal(self, handle: Any) -> None:
        stop = self._goals.add(handle)
        handle.set_accepted()
        threading.Thread(target=self._run, args=(handle, stop), daemon=True).start()

    def _run(self, handle: Any, stop: threading.Event) -> None:
        result = GraspResult()
        try:
            with self._motion_lock:
                stage, verdict = self._carry_out(handle, stop)
            getattr(result, STAGE_FIELDS[stage][1]).data = verdict.reached
            if stop.is_set():
                handle.set_canceled(result, "stopped on request")
            elif verdict.reached:
                handle.set_succeeded(result, verdict.reason)
            else:
                handle.set_aborted(result, verdict.reason)
            rospy.loginfo("%s: %s.", STAGE_FIELDS[stage][0], verdict.reason)
        except (GraspCommandError, CallError, RobotModelError) as error:
            if stop.is_set():
                handle.set_canceled(GraspResult(), "stopped on request")
            else:
                rospy.logerr("Grasp command: %s", error)
                handle.set_aborted(GraspResult(), str(error))
        except Exception as error:  # a client must get a result even if the thread of the goal has died
            rospy.logerr("Grasp command: unexpected %r", error)
            handle.set_aborted(GraspResult(), f"internal error: {error!r}")
        finally:
            self._goals.remove(handle)

    def _carry_out(self, handle: Any, stop: threading.Event) -> tuple[Stage, Verdict]:
        command: GraspCommand = handle.get_goal().grasp_command
        stage = Stage.of(command.grasp_state)
        posture = getattr(command.grasp, STAGE_FIELDS[stage][0]).posture
        targets = posture_targets(posture.name, posture.position, self._group)
        torque = command.grasp.torque_intensity
        intensities = torque_intensities(torque.joint_names, torque.torque_intensity, self._group)
        share = torque_share(command.max_torque, self._full_scale)
        if stop.is_set():
            raise GraspCommandError("stopped on request, before the motion")
        efforts = effort_limits(targets, intensities, self._group, share, stage)
        motion = Motion(targets, efforts, self._timeout_s, stop.is_set)
        now_s = rospy.get_time()
        if now_s < self._last_s:  # reset of the simulation: discard the evidence of earlier motions
            self._evidence = StallEvidence(self._tolerance)
        self._last_s = now_s
        start_state = self._manipulator.joint_state(targets)
        attempt = CommandedMotion(dict(zip(start_state.name, start_state.position, strict=True)), targets, efforts)
        outcome = self._evidence.judge(self._move(handle, motion), attempt)
        return stage, judge(stage, targets, outcome, closed_positions(self._group), self._tolerance)

    def _move(self, handle: Any, motion: Motion) -> Outcome:
        ended = threading.Event()

        def publish() -> None:
            while not ended.wait(FEEDBACK_PERIOD_S):
                with suppress(CallError):  # the next feedback follows soon
                    handle.publish_feedback(
                        GraspFeedback(current_joint_state=self._manipulator.joint_state(motion.targets))
                    )

        threading.Thread(target=publish, daemon=True).start()
        try:
            return self._manipulator.move(motion)
        finally:
            ended.set()


def read_manipulator() -> Group:
    """Reads the manipulator's planning group from the parameter server.

    Raises:
        RobotModelError: A parameter is missing, or the group has no active joint.
    """
    names = ("manipulator_group_name", "robot_description", "robot_description_semantic")
    wait_for_start(lambda: all(rospy.has_param(name) for name in names), f"the parameters {', '.join(names)}")
    missing = [rospy.resolve_name(name) for name in names if not rospy.has_param(name)]
    if missing:
        raise RobotModelError(
            f"the parameters {missing} were not set within {start_timeout():g} s; "
            "load the robot and manipulator_controller_parameters.yaml first"
        )
    name, urdf, srdf = (str(rospy.get_param(parameter)) for parameter in names)
    limits = rospy.get_param("robot_description_planning/joint_limits", {})
    group = read_group(urdf, srdf, name, limits if isinstance(limits, dict) else {})
    if not group.joints:
        raise RobotModelError(f"planning group '{name}' has no active joint; use the planning group of the fingers")
    return group


def read_controllers() -> list[dict[str, Any]]:
    """Reads the controllers from ``~controller_list`` or ``/move_group/controller_list``.

    Raises:
        RobotModelError: No such parameter is set.
    """
    names = ("~controller_list", "/move_group/controller_list", "controller_list")
    wait_for_start(lambda: any(rospy.has_param(name) for name in names), f"one of the parameters {', '.join(names)}")
    for name in names:
        if rospy.has_param(name):
            return list(rospy.get_param(name))
    raise RobotModelError(
        f"none of the parameters {[rospy.resolve_name(name) for name in names]} was set within "
        f"{start_timeout():g} s; load the controllers.yaml of the MoveIt config package"
    )


def main() -> int:
    """Runs the node ``moveit_grasp_action_server``; returns 1 if the description of the manipulator is incomplete.

    Parameters: see ``parameters/moveit_grasp_action_server.yaml``.

    Subscribers: ``joint_states``. Actions called: the action of the controller.
    """
    rospy.init_node("moveit_grasp_action_server")
    read = DeclaredParameters("modular_framework_core", "moveit_grasp_action_server").values
    duration_s, name = read("~motion_duration", "manipulator_controller_action_server_name")
    try:
        group = read_manipulator()
        server = GraspServer(group, ControlledManipulator(read_controllers(), group, duration_s))
    except RobotModelError as error:
        rospy.logfatal("moveit_grasp_action_server: %s", error)
        return 1
    server.connect(name)
    rospy.loginfo("The action server '%s' of the manipulator is ready.", rospy.resolve_name(name))
    rospy.spin()
    return 0
