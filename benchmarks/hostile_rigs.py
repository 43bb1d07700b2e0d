# SPDX-License-Identifier: BSD-3-Clause
"""Robots for hostile goals: hardware, controller manager and trajectory controllers in one loop that the caller steps.

The mock and PyBullet run in simulated time, as fast as the computer can; the emulated UR arm runs in real time.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rospkg
from xacro_rospkg import expand

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.controller_manager.controller_manager import ControllerManager
from modular_framework_control.controllers.joint_trajectory_controller import JointTrajectoryController
from modular_framework_control.hardware_interface.interfaces import COMMAND_INTERFACES
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.realtime.goal_handle import GoalStatus
from modular_framework_control.realtime.loop_time import LoopTime
from modular_framework_control.realtime.scheduling import run_in_real_time
from modular_framework_control.trajectory.trajectory_goal import GoalRejectedError, TrajectoryGoal, TrajectoryGoalHandle
from modular_framework_drivers.ur.ur_arm_robot_hw import JOINT_NAMES, UrArmHardware
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_simulation.models.mesh_files import ConvexParts, default_cache_folder
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.emulators.ur_emulator_process import EmulatedArm

PERIOD_S = 0.008
READY_S = 60.0
LONGEST_STEP_S = 0.05  # as in the node robot_hw: a loop that was held up for longer goes on later
START = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
FAMILIES = {
    "position": "PositionJointInterface",
    "velocity": "VelocityJointInterface",
    "effort": "EffortJointInterface",
    "pos_vel": "PosVelJointInterface",
    "pos_vel_acc": "PosVelAccJointInterface",
}
GAINS = {"velocity": {"p": 8.0}, "effort": {"p": 400.0, "d": 40.0}}
RAMPS_S = {"hold": 0.0, "ramp": 0.5}
"""The two controllers of each robot, with their `stop_trajectory_duration` [s]."""
BRAKING = {"shoulder": 5.0, "elbow": 5.0, "wrist": 8.0}
"""Decelerations that the mock and PyBullet are given as limits, as in the planning limits of the arm [rad/s^2]."""


class Rig:
    """A robot with its two trajectory controllers, of which one runs.

    Args:
        name: what to call it.
        hw: hardware, not yet initialised.
        parameters: of the root namespace; what the hardware reads for itself is below `hw`.
        lag_s: how late its joints follow a command [s].

    Attributes:
        time_s: time of the loop [s].
        running: name of the controller that runs.
        positions, velocities: measured in the last cycle, shape (joints,).
        fastest, braking: limits of the joints, shape (joints,).
        overpowered: joints that move against the largest effort of their motor, shape (joints,).
        longest_gap_s: how late the latest cycle began, because of what else the computer did [s]; 0 in simulated time.
    """

    def __init__(self, name: str, hw: RobotHW, parameters: dict[str, Any], lag_s: float) -> None:
        root = MappingNodeHandle(parameters)
        if not hw.init(root, root.child("hw")):
            raise SystemExit(f"{name}: the hardware refused its parameters; its message is above")
        self.name, self.lag_s, self.time_s = name, lag_s, 0.0
        self.hw = hw
        self.controllers: dict[str, JointTrajectoryController] = {}
        self.manager = ControllerManager(hw, root, attach=self._attach)
        handles = next(interface.handles for interface in map(hw.find, COMMAND_INTERFACES) if interface is not None)
        self._handles = [handle for handle in handles if handle.name in JOINT_NAMES]
        limits = [handle.limits for handle in self._handles]
        self.fastest = np.array([limit.max_velocity for limit in limits])
        self.braking = np.array([limit.max_acceleration for limit in limits])
        self.lowest = np.array([limit.min_position for limit in limits])
        self.highest = np.array([limit.max_position for limit in limits])
        self._efforts = np.array([limit.max_effort for limit in limits])
        self.running = "hold"
        self.longest_gap_s = 0.0
        self._measure()

    def start(self) -> None:
        """Load the controllers and start the first."""
        for name in RAMPS_S:
            self.manager.load_controller(name)
        self.switch(["hold"], [])

    def _attach(self, name: str, controller: Controller) -> Callable[[], None]:
        if not isinstance(controller, JointTrajectoryController):
            raise SystemExit(f"controller '{name}' is a {type(controller).__name__}")
        self.controllers[name] = controller
        return lambda: None

    @property
    def ramp_s(self) -> float:
        """Of the controller that runs."""
        return RAMPS_S[self.running]

    @property
    def rolls(self) -> bool:
        """Whether joints without a controller keep moving, because they have no friction."""
        return self.hw.find(COMMAND_INTERFACES[2]) is not None

    def step(self) -> None:
        """One cycle."""
        period_s = self._next_cycle()
        self.hw.read(self.time_s, period_s)
        self.manager.update(self.time_s, period_s)
        self._measure()
        self.hw.write(self.time_s, period_s)
        self._after_cycle()

    def _next_cycle(self) -> float:
        self.time_s += PERIOD_S
        return PERIOD_S

    def _after_cycle(self) -> None:
        """What goes on between two cycles."""

    def _measure(self) -> None:
        self.positions = np.array([handle.position for handle in self._handles])
        self.velocities = np.array([handle.velocity for handle in self._handles])
        efforts = np.array([handle.effort for handle in self._handles])
        self.overpowered = (np.abs(efforts) >= self._efforts) & (efforts * self.velocities < 0.0)

    def submit(self, goal: TrajectoryGoal, by_topic: bool = False) -> TrajectoryGoalHandle:
        """Send a goal; one that is refused at once ends as rejected. A command has an unused goal handle."""
        goal_handle: TrajectoryGoalHandle = TrajectoryGoalHandle()
        try:
            self.controllers[self.running].submit(goal, None if by_topic else goal_handle)
        except GoalRejectedError as error:
            goal_handle.finish(GoalStatus.REJECTED, error.code, str(error))
        return goal_handle

    def switch(self, start: list[str], stop: list[str]) -> None:
        """Switch controllers while the loop runs."""
        failures: list[Exception] = []

        def ask() -> None:
            try:
                self.manager.switch_controller(start, stop)
            except Exception as error:  # passed to the caller
                failures.append(error)

        thread = threading.Thread(target=ask, daemon=True)
        thread.start()
        while thread.is_alive():
            self.step()
        if failures:
            raise failures[0]
        self.running = start[0] if start else self.running

    def close(self) -> None:
        """End everything."""
        self.manager.stop_all()
        self.hw.close()


class RealTimeRig(Rig):
    """One whose loop waits for the clock, and whose arm is an emulator of its own process."""

    def __init__(self, arm: EmulatedArm) -> None:
        self._arm = arm
        self._due_s = time.monotonic()
        self._loop_time = LoopTime()
        self._loop_time.max_step_s = LONGEST_STEP_S
        super().__init__(
            "ur_emulator", UrArmHardware(), _parameters({"robot_ip_address": arm.address}, "position"), 0.06
        )
        self.time_s = self._loop_time.now()
        run_in_real_time()
        deadline_s = time.monotonic() + READY_S
        while not getattr(self.hw, "ready", False):
            if time.monotonic() > deadline_s:
                raise SystemExit(f"the emulated arm was not ready within {READY_S:g} s: {self.hw.fault()}")
            self.step()

    def _next_cycle(self) -> float:
        self._due_s = max(self._due_s + PERIOD_S, time.monotonic())
        time.sleep(max(0.0, self._due_s - time.monotonic()))
        before_s, self.time_s = self.time_s, self._loop_time.now()
        self.longest_gap_s = max(self.longest_gap_s, time.monotonic() - self._due_s)
        return max(0.0, self.time_s - before_s)

    def close(self) -> None:
        super().close()
        self._arm.close()


class PyBulletRig(Rig):
    """The arm in an empty world."""

    def __init__(self) -> None:
        packages = rospkg.RosPack()
        folder = Path(packages.get_path("ur5_ezgripper_robot"))
        urdf = expand(folder / "urdf" / "ur5_with_ezgripper.urdf.xacro", {"initial_z": "0.86"})
        parts = ConvexParts(default_cache_folder())
        self._world = PhysicsWorld(PhysicsSettings(), parts, (0.0, 0.0, -9.81))
        description = read_robot(urdf, packages.get_path, parts, False)
        body = RobotBody(self._world, description, "robot", Pose(), dict(zip(JOINT_NAMES, START, strict=True)))
        super().__init__(
            "pybullet", SimulatedRobotHW(body), {**_parameters({}, "position"), "robot_description": urdf}, 0.04
        )

    def _next_cycle(self) -> float:
        self.time_s = self._world.time_ns * 1e-9
        return self._world.settings.time_step_s

    def _after_cycle(self) -> None:
        self._world.step()


def mock_rig(family: str) -> Rig:
    """Mock hardware, commanded by one family of interfaces."""
    own = {
        "joints": list(JOINT_NAMES),
        "command_interface": FAMILIES[family],
        "initial_positions": dict(zip(JOINT_NAMES, START, strict=True)),
    }
    parameters = _parameters(own, family)
    for name in JOINT_NAMES:
        parameters["joint_limits"][name] |= {
            "has_position_limits": True,
            "min_position": -6.28,
            "max_position": 6.28,
            "has_velocity_limits": True,
            "max_velocity": 3.15,
            "has_effort_limits": True,
            "max_effort": 150.0,
        }
    return Rig(f"mock, {family}", MockRobotHW(), parameters, 0.15 if family in GAINS else 0.03)


def make_rigs(names: list[str]) -> list[Callable[[], Rig]]:
    """What makes the robots of these names: mock (one for each family), pybullet, ur_emulator."""
    made: list[Callable[[], Rig]] = []
    if "mock" in names:
        made += [lambda family=family: mock_rig(family) for family in FAMILIES]  # type: ignore[misc]
    if "pybullet" in names:
        made.append(PyBulletRig)
    if "ur_emulator" in names:
        made.append(lambda: RealTimeRig(EmulatedArm(positions=START)))
    return made


def _parameters(own: dict[str, Any], family: str) -> dict[str, Any]:
    """Parameters of both controllers, as in the controller file of the arm."""
    tolerances = dict.fromkeys(JOINT_NAMES, {"trajectory": 0.1, "goal": 0.02})
    controllers = {
        name: {
            "type": f"{family}_controllers/JointTrajectoryController",
            "joints": list(JOINT_NAMES),
            "stop_trajectory_duration": ramp_s,
            "gains": dict.fromkeys(JOINT_NAMES, GAINS.get(family)),
            "velocity_ff": dict.fromkeys(JOINT_NAMES, 1.0 if family == "velocity" else 0.0),
            "constraints": {"goal_time": 0.6, "stopped_velocity_tolerance": 0.05, **tolerances},
        }
        for name, ramp_s in RAMPS_S.items()
    }
    braking = {
        name: {"has_acceleration_limits": True, "max_acceleration": BRAKING[name.split("_", 1)[0]]}
        for name in JOINT_NAMES
    }
    return {"hw": own, "joint_limits": braking, **controllers}
