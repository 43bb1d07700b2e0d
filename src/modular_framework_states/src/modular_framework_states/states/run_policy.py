# SPDX-License-Identifier: BSD-3-Clause
"""A state in which a policy in another process drives the arm and the gripper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Unpack

from mbf_method.errors import CallCancelledError, MethodError
from mbf_method.method_client import MethodClient, MethodLimits, MethodSource
from mbf_method.observation import END_EFFECTOR_DELTAS
from mbf_method.openpi import openpi_fields
from mbf_method.served_method import ACTIONS
from mbf_method.wire import OPENPI, PROTOCOL
from modular_framework_core.commander.robot_groups import RobotModelError
from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits, Positive
from modular_framework_core.state_api.option_uses import Named
from modular_framework_ros.calls import CallError
from modular_framework_ros.component_report import ComponentReporter
from modular_framework_ros.reported_figures import POLICY_FAULT
from modular_framework_states.grasp_goals import GraspGoalError
from modular_framework_states.policy_arm import PolicyMotionError
from modular_framework_states.policy_cameras import PolicyCameraError, PolicyCameras
from modular_framework_states.policy_run import PolicyRun
from modular_framework_states.policy_settings import PolicySettings, RecordedEpisode

FAULTS = (CallError, GraspGoalError, PolicyCameraError, PolicyMotionError, RobotModelError)


class RunPolicy(FrameworkState):
    """Lets a policy drive the arm; positive if the policy is done, or after ``max_duration`` without ``must_finish``.

    The policy receives camera images and joint positions, and returns a chunk of actions. The controller of the arm
    executes the first actions of the chunk at ``rate`` and holds the last target until the next chunk. A target outside
    the limits of a joint ends the state without a motion, unless ``clamp`` is true.

    Args:
        command: Program and arguments that start the policy, without a shell; the process ends with the state.
        address: Address of a running policy, such as ws://127.0.0.1:8700, instead of ``command``.
        dataset: Folder of a LeRobot dataset whose ``episode`` is replayed at its ``rate``, instead of ``command``.
        episode: Index of the episode in ``dataset``, from 0.
        openpi_keys: Keys of an openpi-style server at ``address``, by the field they receive: positions, gripper, state
            (positions and gripper), prompt, or a camera; empty for a policy of mbf_method.
        cameras: Topics of colour images, by the name of the camera.
        depth_cameras: Topics of depth images, by the name of the camera.
        prompt: Instruction for the policy.
        actions: Meaning of the columns: joint positions, velocities or deltas (differences of successive positions), or
            end_effector_deltas (translation [m] and rotation vector [rad] of the tip link from the previous target).
        frame: Planning frame or link whose axes end_effector_deltas use; empty for the planning frame.
        joints: Joints that the policy moves, in the order of the columns; empty for all joints of the planning group.
        gripper: Open and closed posture, states of the manipulator's planning group. The last column is then the
            gripper, from 0 (open) to 1 (closed). Empty if the policy has no gripper column.
        rate: Actions per second [Hz].
        horizon: Number of actions in each chunk.
        chunk: Number of actions that run before the next query; 0 for the whole chunk.
        acceleration_limits: Whether the acceleration limits of the joints count, between successive targets.
        clamp: Whether targets outside the limits are moved to the limits.
        max_duration: Maximum duration of the policy [s].
        must_finish: Whether the policy must be done within ``max_duration``.
        start_limit: Maximum time until the policy is ready [s].
        time_limit: Maximum time of a query [s]; afterwards the arm is held and the state fails.
        size_limit: Maximum size of a response [byte].
        camera_timeout: Maximum wait for images [s].
        record_inputs: Folder for copies of the observations, for check_method; empty for no copies.
        **keys: Outcomes and userdata keys of any state.
    """

    DEFAULT_IO_KEYS = ("arm_commander", "manipulator_controller_client", "max_torque")

    def __init__(
        self,
        command: Sequence[str] = (),
        address: str = "",
        dataset: str = "",
        episode: Annotated[int, Limits(at_least=0, at_most=1000000000)] = 0,
        openpi_keys: Mapping[str, str] | None = None,
        cameras: Mapping[str, str] | None = None,
        depth_cameras: Mapping[str, str] | None = None,
        prompt: str = "",
        actions: Literal["positions", "velocities", "deltas", "end_effector_deltas"] = "positions",
        frame: str = "",
        joints: Sequence[str] = (),
        gripper: Annotated[Sequence[str], Named("posture")] = (),
        rate: Positive = 10.0,
        horizon: Annotated[int, Limits(at_least=1, at_most=10000)] = 1,
        chunk: Annotated[int, Limits(at_least=0, at_most=10000)] = 0,
        acceleration_limits: bool = False,
        clamp: bool = False,
        max_duration: Positive = 60.0,
        must_finish: bool = False,
        start_limit: Positive = 60.0,
        time_limit: Positive = 5.0,
        size_limit: Annotated[int, Limits(at_least=1, at_most=1073741824)] = 16777216,
        camera_timeout: Positive = 20.0,
        record_inputs: str = "",
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        self._cameras = PolicyCameras(cameras or {}, depth_cameras or {})
        self._settings = PolicySettings(
            openpi_keys=dict(openpi_keys or {}),
            prompt=prompt,
            kind=actions,
            frame=frame,
            joints=tuple(joints),
            postures=tuple(gripper),
            horizon=int(horizon),
            rate_hz=float(rate),
            executed=int(chunk or horizon),
            accelerates=bool(acceleration_limits),
            clamp=bool(clamp),
            max_duration_s=float(max_duration),
            must_finish=bool(must_finish),
            camera_timeout_s=float(camera_timeout),
        )
        protocol = OPENPI if openpi_keys else PROTOCOL
        self._source = MethodSource(tuple(command), address, record_inputs, protocol)
        self._recorded = RecordedEpisode(Path(dataset).expanduser(), int(episode)) if dataset else None
        self._limits = MethodLimits(float(start_limit), float(time_limit), int(size_limit))
        faults = self._option_faults(openpi_fields(cameras or {}))
        if faults:
            raise ValueError(f"RunPolicy: {'; '.join(faults)}")
        self._reporter = ComponentReporter("policy")

    def _option_faults(self, fields: Sequence[str]) -> list[str]:
        faults, settings = [], self._settings
        sources = (self._source.command, self._source.address, self._recorded)
        if sum(map(bool, sources)) != 1:
            faults.append("give either command, address or dataset")
        if self._recorded is not None and settings.kind != "positions":
            faults.append(f"dataset needs the actions positions; actions is {settings.kind}")
        if settings.openpi_keys and not self._source.address:
            faults.append("openpi_keys needs the address of a server")
        if unknown := sorted(set(settings.openpi_keys) - set(fields)):
            faults.append(f"openpi_keys names {unknown}; allowed: {', '.join(fields)}")
        if settings.kind == END_EFFECTOR_DELTAS and settings.joints:
            faults.append("end_effector_deltas moves all joints of the planning group; remove joints")
        if settings.kind != END_EFFECTOR_DELTAS and settings.frame:
            faults.append("frame needs the actions end_effector_deltas")
        if len(settings.postures) not in (0, 2):
            faults.append(f"gripper has {len(settings.postures)} items; give an open and a closed posture")
        if settings.executed > settings.horizon:
            faults.append(f"chunk is {settings.executed}; it must be at most the horizon, {settings.horizon}")
        return faults

    def execute(self, userdata: Any) -> str:
        """Starts the policy and executes its actions."""
        client = MethodClient(self._source, ACTIONS, self._limits)
        with self._reporter.work("run_policy") as work:
            try:
                PolicyRun(self, userdata, self._settings, self._cameras, self._recorded or client).run(work)
            except MethodError as error:
                work.figures[POLICY_FAULT] = float(error.fault)
                work.reason = f"the policy failed: {error}"
            except (*FAULTS, CallCancelledError) as error:
                work.reason = str(error)
            finally:
                client.close()
        return self.fail(work.reason) if work.reason else self.succeed()
