# SPDX-License-Identifier: BSD-3-Clause
"""Services that hold and advance simulated time, restart the world, and return records of the world."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import rospy
from simulation_time_msgs.srv import AdvanceTime, AdvanceTimeResponse, HoldTime, HoldTimeResponse
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.gazebo_ros import ros_names
from modular_framework_simulation.gazebo_ros.endpoints import caller_of
from modular_framework_simulation.gazebo_ros.planning_scene import PlanningScenePublisher
from modular_framework_simulation.gazebo_ros.world_topics import stamp_of
from modular_framework_simulation.loop.simulation_loop import Hook, SimulationLoop
from modular_framework_simulation.loop.snapshots import WorldSnapshot
from modular_framework_simulation.loop.time_holds import Advance, HoldError
from modular_framework_simulation.loop.world_digest import WorldDigest

_RESPONSE_TIMEOUT_S = 30.0
_WAIT_SLICE_S = 0.2
_MAX_ADVANCE_S = 3600.0
_MAX_STEP_S = 1.0
"""Maximum duration of one request, because the steps run without serving other requests."""
_MIN_REAL_TIME_FACTOR = 0.02
"""Minimum ratio of simulated to real time; a slower request to advance time is cancelled."""


class TimeServices:
    """Serves /gazebo/{hold,advance,step}_time and /gazebo/{restart,referee,record_world,state_digest}.

    Args:
        loop: The simulation loop.
        scene: Planning scene, which is synchronized before a response.
        take_snapshot: Function that copies the state of the world; called by the loop's thread.
        may_hold: Value of the parameter /wait_for_planning: whether nodes may hold time.
        digest: Hash of every step; None if not requested.
        after_restart: Function that is called outside the loop after a restart of the world.
    """

    def __init__(
        self,
        loop: SimulationLoop,
        scene: PlanningScenePublisher,
        take_snapshot: Callable[[], WorldSnapshot],
        *,
        may_hold: bool,
        digest: WorldDigest | None = None,
        after_restart: Callable[[], None] = lambda: None,
    ) -> None:
        self._loop, self._scene, self._take_snapshot, self._may_hold = loop, scene, take_snapshot, may_hold
        self._digest, self._after_restart = digest, after_restart
        if digest is not None:
            loop.add_hook(Hook(0, digest.add))
        self._services: list[rospy.Service] = []

    def connect(self) -> None:
        """Advertises the services."""
        for name, kind, response in (
            (ros_names.HOLD_TIME, HoldTime, self._on_hold),
            (ros_names.ADVANCE_TIME, AdvanceTime, self._on_advance),
            (ros_names.STEP_TIME, AdvanceTime, self._on_step),
            (ros_names.RESTART, Trigger, self._on_restart),
            (ros_names.REFEREE, Trigger, self._on_referee),
            (ros_names.RECORD_WORLD, SetBool, self._on_record),
        ):
            self._serve(name, kind, response)
        if self._digest is not None:
            self._serve(ros_names.STATE_DIGEST, Trigger, self._on_digest)

    def _serve(self, name: str, kind: Any, respond: Callable[[Any], Any]) -> None:
        """Advertises a service with `success` and `message`; logs failures and returns their reason in `message`."""

        def handle(request: Any) -> Any:
            try:
                return respond(request)
            except (HoldError, SimulationError) as error:
                rospy.logerr("%s: %s", name, error)
                return kind._response_class(success=False, message=str(error))

        self._services.append(rospy.Service(name, kind, handle))

    def close(self) -> None:
        """Closes the services; may be called twice."""
        while self._services:
            self._services.pop().shutdown("the simulation ends")

    def _in_loop(self, name: str, function: Callable[[], Any]) -> Any:
        return self._loop.requests.call(name, function, _RESPONSE_TIMEOUT_S)

    def _on_hold(self, request: Any) -> HoldTimeResponse:
        holds = self._loop.holds

        def hold_time() -> Any:
            if request.lease_s == 0.0:
                holds.release(request.owner)
            else:
                holds.hold(request.owner, request.lease_s, request.during_motions)
            return stamp_of(self._loop.world)

        if not self._may_hold:
            raise HoldError("simulated time cannot be held, because /wait_for_planning is false")
        return HoldTimeResponse(success=True, stamp=self._in_loop(ros_names.HOLD_TIME, hold_time))

    def _on_advance(self, request: Any) -> AdvanceTimeResponse:
        duration_s = request.duration.to_sec()
        if not 0.0 <= duration_s <= _MAX_ADVANCE_S:
            raise HoldError(f"duration is {duration_s:g} s; allowed: 0 to {_MAX_ADVANCE_S:g} s")
        if duration_s > 0.0:
            self._advance(duration_s)
        stamp, held = self._synchronized_now()
        return AdvanceTimeResponse(success=True, stamp=stamp, held=held)

    def _on_step(self, request: Any) -> AdvanceTimeResponse:
        """Advances paused time by a duration, rounded up to at least one physics step."""
        duration_s = request.duration.to_sec()
        if not 0.0 <= duration_s <= _MAX_STEP_S:
            raise HoldError(f"duration is {duration_s:g} s; allowed: 0 (one step) to {_MAX_STEP_S:g} s")
        stamp = self._in_loop(ros_names.STEP_TIME, lambda: self._step(duration_s))
        return AdvanceTimeResponse(success=True, stamp=stamp, held=True)

    def _step(self, duration_s: float) -> rospy.Time:
        if not self._loop.paused:
            raise HoldError(f"time is not paused; call {ros_names.PAUSE_PHYSICS} first")
        for _ in range(self._whole_steps(duration_s)):
            self._loop.step()
        return stamp_of(self._loop.world)

    def _whole_steps(self, duration_s: float) -> int:
        return max(1, math.ceil(duration_s / self._loop.world.settings.time_step_s - 1e-6))

    def _advance(self, duration_s: float) -> None:
        """Waits until time has advanced by a duration, rounded up to physics steps, or the world has restarted."""
        holds, count = self._loop.holds, self._whole_steps(duration_s)
        request: Advance = self._in_loop(ros_names.ADVANCE_TIME, lambda: holds.advance(self._loop.world.steps + count))
        waited_s, limit_s = 0.0, _RESPONSE_TIMEOUT_S + duration_s / _MIN_REAL_TIME_FACTOR
        while not request.passed.wait(_WAIT_SLICE_S):
            waited_s += _WAIT_SLICE_S
            if waited_s > limit_s or rospy.is_shutdown():
                self._loop.requests.post(lambda: holds.give_up(request))
                state = "paused" if self._loop.paused else f"held by {', '.join(holds.owners) or 'nobody'}"
                raise HoldError(f"{duration_s:g} s did not pass within {waited_s:.0f} s of real time; time is {state}")

    def _synchronized_now(self) -> tuple[rospy.Time, bool]:
        """Returns the current time and whether it is held; if so, the planning scene is synchronized first."""
        stamp, held, snapshot = self._in_loop(ros_names.ADVANCE_TIME, self._now)
        if snapshot is not None:
            self._scene.bring_up_to_date(snapshot)
        return stamp, held

    def _now(self) -> tuple[rospy.Time, bool, WorldSnapshot | None]:
        held, world = self._loop.held, self._loop.world
        outdated = held and not self._scene.is_up_to_date(world.time_ns, world.revision)
        return stamp_of(self._loop.world), held, self._take_snapshot() if outdated else None

    def _on_restart(self, request: Any) -> TriggerResponse:
        self._in_loop(ros_names.RESTART, self._loop.restart)
        self._loop.referee.note(ros_names.RESTART, caller_of(request))
        self._after_restart()
        return TriggerResponse(success=True, message="the world is in its initial state")

    def _on_referee(self, _request: Any) -> TriggerResponse:
        """Returns the held objects, the poses of all models (x, y, z [m], xyzw) and the interventions as JSON.

        A running record gets a sample of the same moment.
        """
        world = self._loop.world

        def read() -> dict[str, Any]:
            self._loop.record.sample()
            poses = {name: world.body(name).state().pose for name in world.names()}
            return {
                "held": sorted({held.model for held in self._loop.held_objects()}),
                "poses": {name: (*pose.position, *pose.quaternion) for name, pose in poses.items()},
                "interventions": [asdict(each) for each in self._loop.referee.interventions],
            }

        return TriggerResponse(success=True, message=json.dumps(self._in_loop(ros_names.REFEREE, read)))

    def _on_record(self, request: Any) -> SetBoolResponse:
        """Starts a record of the world (`data` true), or ends the record and returns it as JSON.

        The referee notes each call, so that only the node that placed the objects can start or end the record unseen.
        """
        record = self._loop.record
        self._loop.referee.note(ros_names.RECORD_WORLD, caller_of(request))
        if request.data:
            self._in_loop(ros_names.RECORD_WORLD, record.start)
            return SetBoolResponse(success=True, message="the record of the world has started")
        return SetBoolResponse(success=True, message=json.dumps(self._in_loop(ros_names.RECORD_WORLD, record.stop)))

    def _on_digest(self, _request: Any) -> TriggerResponse:
        digest = self._digest
        assert digest is not None
        found = self._in_loop(ros_names.STATE_DIGEST, lambda: (*digest.checkpoints, digest.current_checkpoint()))
        return TriggerResponse(success=True, message=json.dumps([[item.step, item.digest] for item in found]))
