# SPDX-License-Identifier: BSD-3-Clause
"""The loop of a policy: observe, query, check, execute."""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import rospy

from mbf_method.actions import checked_actions, limited_targets
from mbf_method.errors import InvalidOutputError
from mbf_method.grasp_request import RobotState
from mbf_method.method_client import MethodClient
from mbf_method.observation import END_EFFECTOR_COLUMNS, END_EFFECTOR_DELTAS, Observation
from mbf_method.openpi import openpi_request
from modular_framework_core.grasping.ros_grasp_server import read_controllers
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_ros.component_report import ReportedMethod, Work
from modular_framework_ros.seeds import MAX_SEED, derived_seed, seed_parameter
from modular_framework_ros.simulated_time import SimulatedTime
from modular_framework_states.manipulator_postures import posture_positions
from modular_framework_states.policy_actions import end_effector_spec, joint_action_spec
from modular_framework_states.policy_arm import PolicyArm, PolicyMotionError, trajectory_action
from modular_framework_states.policy_cameras import PolicyCameras
from modular_framework_states.policy_figures import PolicyFigures
from modular_framework_states.policy_gripper import PolicyGripper
from modular_framework_states.policy_settings import PolicySettings, RecordedEpisode

if TYPE_CHECKING:
    from modular_framework_states.policy_end_effector import EndEffector
    from modular_framework_states.policy_replay import RecordedPolicy

Array = npt.NDArray[np.float64]

PERIOD_S = 0.005
MOTION_WAIT_S = 10.0
"""Maximum time beyond the duration of a chunk, and for the arm to settle at the end [s]."""


class PolicyRun:
    """One run of a policy.

    Args:
        state: State that runs the policy; a stop request ends the run.
        userdata: Userdata with the commander and the client of the gripper.
        settings: Options of the task.
        cameras: Cameras of the observation.
        source: Client of the policy, or a recorded episode in place of a policy.
    """

    def __init__(
        self,
        state: FrameworkState,
        userdata: Any,
        settings: PolicySettings,
        cameras: PolicyCameras,
        source: MethodClient | RecordedEpisode,
    ) -> None:
        self._state, self._settings, self._cameras = state, settings, cameras
        self._commander = userdata.arm_commander
        self._gripper = _gripper(settings.postures, userdata)
        self._client = source if isinstance(source, MethodClient) else self._make_recorded_policy(source)
        moves_tip = settings.kind == END_EFFECTOR_DELTAS
        self._joints = self._spec = joint_action_spec(
            self._commander.group,
            settings.joints,
            "positions" if moves_tip else settings.kind,
            has_gripper=self._gripper is not None,
            timing=(settings.horizon, settings.rate_hz),
            accelerates=settings.accelerates,
        )
        joints = self._joints.joint_names
        self._end_effector = self._make_end_effector(joints) if moves_tip else None
        if self._end_effector is not None:
            self._spec = end_effector_spec(self._joints, self._end_effector.link, self._end_effector.frame)
        self._arm = PolicyArm(trajectory_action(read_controllers(), joints), joints, settings.rate_hz)
        self._time = SimulatedTime()
        self._step, self._start_s = 0, 0.0

    def _make_end_effector(self, joints: Sequence[str]) -> EndEffector:
        from modular_framework_states.policy_end_effector import EndEffector, load_solver  # loads the planner

        solver = load_solver(self._commander.group.name)
        return EndEffector(solver, joints, self._settings.frame, self._commander.positions_of)

    def _make_recorded_policy(self, episode: RecordedEpisode) -> RecordedPolicy:
        from modular_framework_states.policy_replay import RecordedPolicy  # loads pyarrow

        units = {joint.name: "m" if joint.is_prismatic else "rad" for joint in self._commander.group.joints}
        return RecordedPolicy(episode, units, self._gripper)

    def run(self, work: Work) -> None:
        """Lets the policy drive until it is done or its time is over; the arm is held afterwards.

        Args:
            work: Receives the figures of the run, and the method that the record names.

        Raises:
            MethodError: The policy returned no valid actions; the class of the error is the kind of fault.
            PolicyMotionError: The controller did not execute a chunk, or the policy was not done in time.
            CallCancelledError: A stop was requested during a query.
            CallError, GraspGoalError, PolicyCameraError: A controller, the gripper or a camera is missing.
        """
        self._arm.connect()
        self._client.start()
        work.method = _reported(self._client)
        self._start_s = rospy.get_time()
        try:
            is_done = self._drive(PolicyFigures(work.figures, self._settings.rate_hz))
            self._settle()
        finally:
            self._arm.stop()
        if not is_done and self._settings.must_finish:
            raise PolicyMotionError(f"the policy was not done within {self._settings.max_duration_s:g} s")

    def _drive(self, figures: PolicyFigures) -> bool:
        """Executes chunks; returns whether the policy is done."""
        target = before = np.zeros(0)
        while not self._state.stop_requested():
            left = (self._settings.max_duration_s - (rospy.get_time() - self._start_s)) * self._settings.rate_hz
            if left < 1.0:
                return False
            with self._time.held("run_policy"):
                observation = self._observation()
                actions = self._actions(observation, figures)
                if not len(actions):
                    return True
                if not self._step:
                    gripper = [] if self._gripper is None else [observation.gripper]
                    target = before = np.append(observation.robot.positions, gripper)
                targets = limited_targets(self._joint_actions(actions, target), self._joints, target, before)
            if targets.fault and not self._settings.clamp:
                raise InvalidOutputError(targets.fault)
            executed = targets.values[: int(min(self._settings.executed, left))]
            self._execute(executed)
            before, target = (target, *executed)[-2:]
            self._step += len(executed)
            figures.add_chunk(targets.clipped[: len(executed)])
        return False

    def _observation(self) -> Observation:
        joints, setting = self._joints.joint_names, self._settings
        cameras = self._cameras.take(setting.camera_timeout_s)
        observed = [*joints] if self._gripper is None else [*joints, self._gripper.observed_joint]
        positions = self._commander.positions_of(observed)
        if missing := [name for name in observed if name not in positions]:
            raise PolicyMotionError(f"topic '{rospy.resolve_name('joint_states')}' lacks the joints {missing}")
        robot = RobotState(joints, np.array([positions[name] for name in joints]))
        tip = self._end_effector
        return Observation(
            robot=robot,
            gripper=0.0 if self._gripper is None else self._gripper.fraction_at(positions[observed[-1]]),
            cameras=cameras,
            prompt=setting.prompt,
            time_s=rospy.get_time() - self._start_s,
            step=self._step,
            actions=self._spec,
            seed=_seed(self._step),
            end_effector=np.zeros((0, 0)) if tip is None else tip.pose(robot.positions),
        )

    def _actions(self, observation: Observation, figures: PolicyFigures) -> Array:
        """Returns the checked actions of the policy, and adds the query to the figures."""
        keys = self._settings.openpi_keys
        request = openpi_request(observation, keys) if keys else observation
        result = self._client.call(request, is_cancelled=self._state.stop_requested)
        figures.add_query(result.times)
        return checked_actions(result.message, self._spec)

    def _joint_actions(self, actions: Array, target: Array) -> Array:
        """Returns the actions with joint columns.

        Args:
            actions: Checked actions, shape (n, a).
            target: Target before the first action, shape (j,) or (j + 1,) with a gripper.
        """
        if self._end_effector is None:
            return actions
        columns = len(END_EFFECTOR_COLUMNS)
        start = target[: len(self._joints.joint_names)]
        return np.hstack([self._end_effector.follow(actions[:, :columns], start), actions[:, columns:]])

    def _execute(self, targets: Array) -> None:
        """Executes targets, shape (n, a), and returns at the time of the last target."""
        joints, next_row = len(self._joints.joint_names), 0
        self._arm.start(targets[:, :joints])

        def is_over() -> bool:
            nonlocal next_row
            reached = min(self._arm.reached_targets(), len(targets) - 1)
            if self._gripper is not None and reached >= next_row:
                self._gripper.move(float(targets[reached, -1]))
                next_row = reached + 1
            return self._arm.has_ended() or self._arm.reached_targets() >= len(targets)

        duration_s = len(targets) / self._settings.rate_hz
        is_in_time = self._state.wait_until(is_over, duration_s + MOTION_WAIT_S, PERIOD_S)
        self._refuse_fault(is_in_time, f"{duration_s + MOTION_WAIT_S:g} s")

    def _settle(self) -> None:
        """Waits until the controller has ended the last chunk."""
        if self._step and not self._state.stop_requested():
            is_in_time = self._state.wait_until(self._arm.has_ended, MOTION_WAIT_S, PERIOD_S)
            self._refuse_fault(is_in_time, f"{MOTION_WAIT_S:g} s after the last target")

    def _refuse_fault(self, is_in_time: bool, limit: str) -> None:
        if fault := self._arm.fault():
            raise PolicyMotionError(fault)
        if not is_in_time and not self._state.stop_requested():
            raise PolicyMotionError(f"the motion of a chunk was not over within {limit}")


def _gripper(postures: tuple[str, ...], userdata: Any) -> PolicyGripper | None:
    """Returns the gripper between two postures; None without postures."""
    if not postures:
        return None
    opened, closed = (posture_positions(name) for name in postures)
    return PolicyGripper(opened, closed, userdata.manipulator_controller_client, userdata.max_torque)


def _reported(client: MethodClient | RecordedPolicy) -> ReportedMethod:
    """Returns the report of a started method."""
    return ReportedMethod(
        command=client.source.command,
        address=client.source.address,
        sources=client.sources,
        said_name=client.said_name,
        said_version=client.said_version,
    )


def _seed(step: int) -> int:
    """Returns the seed of a query, derived from the parameter ``/seed``; random if the parameter is not set."""
    seed = seed_parameter()
    return secrets.randbelow(MAX_SEED + 1) if seed is None else derived_seed(seed, "run_policy", step)
