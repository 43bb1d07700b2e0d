# SPDX-License-Identifier: BSD-3-Clause
"""Simulation loop, which advances controllers, physics and simulated time in lock-step in one thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from modular_framework_simulation.loop.grasp_watch import GraspWatch
from modular_framework_simulation.loop.pacing import Pacer
from modular_framework_simulation.loop.referee import Referee
from modular_framework_simulation.loop.request_queue import RequestQueue
from modular_framework_simulation.loop.snapshots import HeldObject
from modular_framework_simulation.loop.time_holds import TimeHolds
from modular_framework_simulation.loop.world_record import WorldRecord
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.model_changes import set_joint_positions
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW

_PAUSED_TICK_S = 0.05
_HELD_TICK_S = 0.004
"""Real time between two checks for goals while time is held [s]."""
_STEPS_BEFORE_HOLD = 5
"""Physics steps after a restart before time may be held; at time 0, nodes assume that the clock has not started."""
_HALT_S = (0.1, 0.5)
"""Minimum and maximum simulated time after `stop` [s]; the minimum allows to publish the robot's standstill."""
_REST_VELOCITY = 0.01


class Controllers(Protocol):
    """Methods of a controller manager that the loop calls."""

    @property
    def moving(self) -> bool:
        """Returns whether a controller executes a goal."""

    def update(self, time_s: float, period_s: float, reset_controllers: bool = False, reset_reason: str = "") -> None:
        """Runs one control cycle.

        Args:
            time_s: Simulated time [s].
            period_s: Time since the last cycle [s].
            reset_controllers: Whether the controllers restart first, which ends their goals.
            reset_reason: Reason of the restart in the goals' results.
        """


@dataclass(frozen=True, slots=True)
class Hook:
    """Action that the loop's thread repeats while time advances.

    Attributes:
        period_ns: Period in simulated time [ns]; 0 for every physics step.
        action: Function that must return quickly.
    """

    period_ns: int
    action: Callable[[], None]


@dataclass(frozen=True, slots=True)
class Actors:
    """The robot in the world with its hardware and controllers."""

    robot: RobotBody
    hardware: SimulatedRobotHW
    controllers: Controllers


class SimulationLoop:
    """Advances the world.

    Args:
        world: The world.
        pacer: Synchronization of simulated and real time.
        requests: Requests of other threads.
        actors: The robot; None for a world without a robot.
        on_paused_tick: Function called about 20 times per second while time is stopped, to keep the clock published.
        holds: Holds of simulated time; None for no holds.
    """

    def __init__(
        self,
        world: PhysicsWorld,
        pacer: Pacer,
        requests: RequestQueue,
        actors: Actors | None,
        *,
        on_paused_tick: Callable[[], None] = lambda: None,
        holds: TimeHolds | None = None,
    ) -> None:
        self.world = world
        self.pacer = pacer
        self.requests = requests
        self.referee = Referee(world)
        self._actors = actors
        self.grasp_watches = tuple(GraspWatch() for _ in actors.robot.grippers) if actors is not None else ()
        self.record = WorldRecord(world, lambda: {watch.held for watch in self.grasp_watches if watch.held is not None})
        self._hooks: list[Hook] = []
        self._hook_periods: list[int] = []
        self._on_paused_tick = on_paused_tick
        self.holds = holds if holds is not None else TimeHolds(print)
        self._held_at = -1
        self._next_tick_s = 0.0
        self._paused = False
        self._stop = threading.Event()
        self._reset_reason = ""

    @property
    def held(self) -> bool:
        """Returns whether time is stopped by a hold."""
        return self._held_at >= 0

    @property
    def paused(self) -> bool:
        """Returns whether time is paused."""
        return self._paused

    def add_hook(self, hook: Hook) -> None:
        """Adds an action that is repeated while time advances; must be called before `run`."""
        self._hooks.append(hook)
        self._hook_periods.append(0)

    def pause(self) -> None:
        """Pauses time; requests are still executed."""
        self._paused = True

    def unpause(self) -> None:
        """Resumes time."""
        self._paused = False
        self.pacer.start(self._time_s())

    def reset_poses(self) -> None:
        """Resets the models and the robot to their initial poses at rest, and removes requested forces.

        Time continues. The goals of controllers end with this reason.
        """
        self.world.reset_poses()
        self._restart_robot(RobotBody.reset, "the world was reset")

    def set_joints(self, name: str, positions: dict[str, float]) -> None:
        """Sets joint positions of a model or robot, at rest.

        Args:
            name: Name of the model or robot.
            positions: Positions by joint name [rad or m].

        Raises:
            UnknownEntityError: The model or a joint does not exist.
            ModelChangeError: A position exceeds a limit, or a joint does not keep its position.
        """
        set_joint_positions(self.world, name, positions)
        if self._actors is not None and self.world.body(name) is self._actors.robot.body:
            self._restart_control("a request changed the joint positions")

    def _restart_robot(self, place: Callable[[RobotBody], None], reason: str) -> None:
        """Resets the robot and the held objects, and restarts the robot's control."""
        for watch in self.grasp_watches:
            watch.reset()
        if self._actors is not None:
            place(self._actors.robot)
        self._restart_control(reason)

    def _restart_control(self, reason: str) -> None:
        """Restarts hardware and controllers at the current joint positions; goals end with the reason."""
        if self._actors is not None:
            self._actors.hardware.read(self._time_s(), 0.0)
            self._actors.hardware.hold()
        self._reset_reason = reason

    def reset_all(self) -> None:
        """Resets the models and the robot to their initial poses, removes requested forces, and sets time to 0.

        Goals of controllers and requests to advance time end.
        """
        self.world.reset_time()
        self.world.reset_poses()
        self._restart_robot(RobotBody.reset, "the simulation was reset")
        self._begin_time(_STEPS_BEFORE_HOLD if self.holds.owners else 0)

    def restart(self) -> None:
        """Restarts in an empty physics engine with the initial world; spawned models are removed."""
        self.world.restart()
        self.pacer.reset_factor()
        self._restart_robot(RobotBody.reload, "the world was restarted")
        self._begin_time(_STEPS_BEFORE_HOLD)

    def _begin_time(self, steps: int) -> None:
        """Ends requests to advance time, runs the first steps, and restarts the pacing."""
        self.holds.restart()
        for _ in range(steps):
            self.step()
        self._held_at = -1
        self.pacer.start(self._time_s())

    def stop(self) -> None:
        """Makes `run` return; may be called from any thread."""
        self._stop.set()

    def run(self) -> None:
        """Advances the world until `stop` is called, and then stops a moving robot."""
        self.pacer.start(self._time_s())
        while not self._stop.is_set():
            self.requests.run_pending()
            moving = self._actors is not None and self._actors.controllers.moving
            if self._paused:
                self._on_paused_tick()
                if self._actors is not None:
                    # Controllers can also be loaded and started while time is paused.
                    self._update_controllers(self._actors.controllers, 0.0)
                self.requests.wait(_PAUSED_TICK_S)
            elif self.holds.may_pass(self.world.steps, moving):
                self._pass_time(calm=not moving and self._is_at_rest())
            else:
                self._stand_still()
        if self._actors is not None and not self._paused:
            self._halt(self._actors.robot)

    def _pass_time(self, calm: bool) -> None:
        if self.held:
            self._held_at = -1
            self.pacer.start(self._time_s())
        self.step()
        idle = not self.holds.owners
        self.pacer.keep(self._time_s(), idle, calm, still=idle and calm and self._actors is not None)

    def _stand_still(self) -> None:
        """Makes the controllers accept goals while time is held; the first call also publishes the current state."""
        now_s, first = self._time_s(), self._held_at != self.world.steps
        if first:
            self._held_at = self.world.steps
            if self._actors is not None:
                self._actors.hardware.read(now_s, 0.0)
        if self._actors is not None:
            self._update_controllers(self._actors.controllers, 0.0)
        if first or time.monotonic() >= self._next_tick_s:
            self._next_tick_s = time.monotonic() + _PAUSED_TICK_S
            self._on_paused_tick()
        self.requests.wait(_HELD_TICK_S)

    def _halt(self, robot: RobotBody) -> None:
        """Makes the controllers hold the robot at its current position, and continues until the robot is at rest."""
        self._restart_control("the simulation ends")
        start_s = self._time_s()
        for duration_s in _HALT_S:
            while self._time_s() - start_s < duration_s:
                self.step()
                self.pacer.keep(self._time_s())
            robot.read()
            if self._is_at_rest():
                return

    def _is_at_rest(self) -> bool:
        """Returns whether no joint of the robot moved at the last measurement."""
        return self._actors is None or all(
            abs(joint.velocity) < _REST_VELOCITY for joint in self._actors.robot.readings
        )

    def _update_controllers(self, controllers: Controllers, period_s: float) -> None:
        reason, self._reset_reason = self._reset_reason, ""
        if reason:
            controllers.update(self._time_s(), period_s, True, reason)
        else:
            controllers.update(self._time_s(), period_s)

    def step(self) -> None:
        """Advances the world by one physics step: read, update, write, and simulate."""
        period_s = self.world.settings.time_step_s
        if self._actors is not None:
            now_s = self._time_s()
            self._actors.hardware.read(now_s, period_s)
            self._update_controllers(self._actors.controllers, period_s)
            self._actors.hardware.write(now_s, period_s)
        self.world.step()
        time_ns = self.world.time_ns
        for index, hook in enumerate(self._hooks):
            period_index = time_ns // hook.period_ns if hook.period_ns else self.world.steps
            before, self._hook_periods[index] = self._hook_periods[index], period_index
            if period_index > before:
                hook.action()

    def watch_grasps(self) -> None:
        """Updates the grasp watches with the contacts of the fingers, and calls the referee; used as a hook."""
        self.referee.look_for_jumps()
        if self._actors is None:
            return
        robot = self._actors.robot
        for gripper, watch in zip(robot.grippers, self.grasp_watches, strict=True):
            watch.update(self._time_s(), [self._touched_objects(robot, side) for side in gripper.sides])
        self.world.carry(robot.body, [(held.model, held.carrier_link) for held in self.held_objects()])

    def _touched_objects(self, robot: RobotBody, links: Sequence[int]) -> set[str]:
        """Returns the names of the movable objects that links press on."""
        contacts = [contact for link in links for contact in self.world.contacts(robot.body, link)]
        # The engine also lists close bodies without contact force.
        return {each.model for each in contacts if each.force > 0.0 and not self.world.body(each.model).static}

    def held_objects(self) -> tuple[HeldObject, ...]:
        """Returns the currently held objects; an object in two grippers is held by the first gripper."""
        if self._actors is None:
            return ()
        robot = self._actors.robot
        held: dict[str, HeldObject] = {}
        for gripper, watch in zip(robot.grippers, self.grasp_watches, strict=True):
            if watch.held is not None and watch.held not in held and watch.held in self.world.names():
                palm_in_world: Pose = robot.body.link_state(gripper.palm_link).pose
                held[watch.held] = HeldObject(watch.held, gripper.palm_link, palm_in_world, gripper.links)
        return tuple(held.values())

    def _time_s(self) -> float:
        return self.world.time_ns * 1e-9
