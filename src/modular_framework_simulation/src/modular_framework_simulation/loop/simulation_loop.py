# SPDX-License-Identifier: BSD-3-Clause
"""The loop: controllers, physics and simulated time advance together, one step after the other, in one thread."""

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
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.model_changes import set_joint_positions
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW

_PAUSED_TICK_S = 0.05
_HELD_TICK_S = 0.004
"""Real time between two looks for goals while time is held [s]."""
_STEPS_BEFORE_HOLD = 5
"""Physics steps after a restart before time may be held: at time 0 nodes take the clock for not yet started."""
_HALT_S = (0.1, 0.5)
"""How long the robot is simulated after `stop` [s]: at least, so that its standstill is published; at most."""
_AT_REST = 0.01


class Controllers(Protocol):
    """The methods of a controller manager that the loop calls."""

    @property
    def moving(self) -> bool:
        """Whether a controller carries out a goal."""

    def update(self, time_s: float, period_s: float, reset_controllers: bool = False, reset_reason: str = "") -> None:
        """Runs one control cycle; a reset restarts the controllers first, and their goals end with the reason."""


@dataclass(frozen=True, slots=True)
class Hook:
    """An action that the loop's thread repeats while time advances.

    Attributes:
        period_ns: Simulated time from one call to the next [ns]; 0: every physics step.
        action: Must be quick.
    """

    period_ns: int
    action: Callable[[], None]


@dataclass(frozen=True, slots=True)
class Actors:
    """The robot in the world and what drives it; a world without a robot has none."""

    robot: RobotBody
    hardware: SimulatedRobotHW
    controllers: Controllers


class SimulationLoop:
    """Advances the world.

    Args:
        world: What to advance.
        pacer: Ties simulated to real time.
        requests: Work of other threads.
        actors: The robot; None for a world without one.
        on_paused_tick: Called about 20 times a second while time stands still, so that the clock stays visible.
        holds: Who holds time; nobody by default.
    """

    def __init__(
        self,
        world: PhysicsWorld,
        pacer: Pacer,
        requests: RequestQueue,
        actors: Actors | None,
        on_paused_tick: Callable[[], None] = lambda: None,
        holds: TimeHolds | None = None,
    ) -> None:
        self.world = world
        self.pacer = pacer
        self.requests = requests
        self.referee = Referee(world)
        self._actors = actors
        self.grasp_watches = tuple(GraspWatch() for _ in actors.robot.grippers) if actors is not None else ()
        self._hooks: list[Hook] = []
        self._hook_turns: list[int] = []
        self._on_paused_tick = on_paused_tick
        self.holds = holds if holds is not None else TimeHolds(print)
        self._held_at = -1
        self._next_tick_s = 0.0
        self._paused = False
        self._stop = threading.Event()
        self._reset_reason = ""

    @property
    def held(self) -> bool:
        """Whether time stands still because somebody holds it."""
        return self._held_at >= 0

    @property
    def paused(self) -> bool:
        """Whether time is paused."""
        return self._paused

    def add_hook(self, hook: Hook) -> None:
        """Adds an action that is repeated while time advances; to be called before `run`."""
        self._hooks.append(hook)
        self._hook_turns.append(0)

    def pause(self) -> None:
        """Stops time; requests are still carried out."""
        self._paused = True

    def unpause(self) -> None:
        """Resumes time."""
        self._paused = False
        self.pacer.start(self._time_s())

    def reset_poses(self) -> None:
        """Puts models and robot at their initial poses, at rest, without forces of requests; time continues.

        Goals that controllers carry out end with that reason.
        """
        self.world.reset_poses()
        self._restart_robot(RobotBody.reset, "the world was reset")

    def set_joints(self, name: str, positions: dict[str, float]) -> None:
        """Puts joints of a model or of the robot at positions [rad or m], at rest.

        Raises:
            UnknownEntityError: There is no such model, or it has no such joint.
            ModelChangeError: A position is beyond a limit, or a joint is not where it was put.
        """
        set_joint_positions(self.world, name, positions)
        if self._actors is not None and self.world.body(name) is self._actors.robot.body:
            self._restart_control("the joints were put elsewhere by a request")

    def _restart_robot(self, place: Callable[[RobotBody], None], reason: str) -> None:
        """Puts the robot where it starts, with empty grippers, and restarts what drives it."""
        for watch in self.grasp_watches:
            watch.reset()
        if self._actors is not None:
            place(self._actors.robot)
        self._restart_control(reason)

    def _restart_control(self, reason: str) -> None:
        """Restarts hardware and controllers from the present joint positions; goals end with the reason."""
        if self._actors is not None:
            self._actors.hardware.read(self._time_s(), 0.0)
            self._actors.hardware.hold()
        self._reset_reason = reason

    def reset_all(self) -> None:
        """Puts models and robot where they started, without forces of requests, and simulated time to 0.

        Goals that controllers carry out, and requests for time to pass, end.
        """
        self.world.reset_time()
        self.world.reset_poses()
        self._restart_robot(RobotBody.reset, "the simulation was reset")
        self._begin_time(_STEPS_BEFORE_HOLD if self.holds.owners else 0)

    def restart(self) -> None:
        """Begins again in an empty physics engine, with the world as at the start; spawned models are gone."""
        self.world.restart()
        self.pacer.reset_factor()
        self._restart_robot(RobotBody.reload, "the world began again")
        self._begin_time(_STEPS_BEFORE_HOLD)

    def _begin_time(self, steps: int) -> None:
        """Ends requests for time to pass, makes the first steps, and keeps pace from there."""
        self.holds.restart()
        for _ in range(steps):
            self.step()
        self._held_at = -1
        self.pacer.start(self._time_s())

    def stop(self) -> None:
        """Makes `run` return; may be called from any thread."""
        self._stop.set()

    def run(self) -> None:
        """Advances the world until `stop` is called; a robot that moves then is brought to rest first."""
        self.pacer.start(self._time_s())
        while not self._stop.is_set():
            self.requests.run_pending()
            moving = self._actors is not None and self._actors.controllers.moving
            if self._paused:
                self._on_paused_tick()
                if self._actors is not None:
                    # Controllers can be loaded and started while time is paused.
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
        """Lets the controllers take up goals while time is held; at first, lets them report the state of now."""
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
        """Lets the controllers hold the robot at its present position, and continues until it is at rest."""
        self._restart_control("the simulation ends")
        begun_s = self._time_s()
        for shortest_s in _HALT_S:
            while self._time_s() - begun_s < shortest_s:
                self.step()
                self.pacer.keep(self._time_s())
            robot.read()
            if self._is_at_rest():
                return

    def _is_at_rest(self) -> bool:
        """Whether no joint of the robot moved when they were last measured."""
        return self._actors is None or all(abs(joint.velocity) < _AT_REST for joint in self._actors.robot.readings)

    def _update_controllers(self, controllers: Controllers, period_s: float) -> None:
        reason, self._reset_reason = self._reset_reason, ""
        if reason:
            controllers.update(self._time_s(), period_s, True, reason)
        else:
            controllers.update(self._time_s(), period_s)

    def step(self) -> None:
        """Advances the world by one physics step: measure, control, actuate, move."""
        period_s = self.world.settings.time_step_s
        if self._actors is not None:
            now_s = self._time_s()
            self._actors.hardware.read(now_s, period_s)
            self._update_controllers(self._actors.controllers, period_s)
            self._actors.hardware.write(now_s, period_s)
        self.world.step()
        time_ns = self.world.time_ns
        for rank, hook in enumerate(self._hooks):
            turn = time_ns // hook.period_ns if hook.period_ns else self.world.steps
            before, self._hook_turns[rank] = self._hook_turns[rank], turn
            if turn > before:
                hook.action()

    def watch_grasps(self) -> None:
        """Passes the contacts of the fingers to the grasp watch of their gripper, and lets the referee look; a hook."""
        self.referee.look()
        if self._actors is None:
            return
        robot = self._actors.robot
        for gripper, watch in zip(robot.grippers, self.grasp_watches, strict=True):
            watch.update(self._time_s(), [self._touched(robot, finger) for finger in gripper.fingers])
        self.world.carry(robot.body, [(held.model, held.carrier_link) for held in self.held_objects()])

    def _touched(self, robot: RobotBody, finger: Sequence[int]) -> set[str]:
        """Returns the movable objects that a finger presses on."""
        contacts = [contact for link in finger for contact in self.world.contacts(robot.body, link)]
        # The engine also lists bodies that are near each other and do not press.
        return {each.model for each in contacts if each.force > 0.0 and not self.world.body(each.model).static}

    def held_objects(self) -> tuple[HeldObject, ...]:
        """Returns what the grippers hold now; an object in two of them counts as held by the first."""
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
