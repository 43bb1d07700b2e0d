# SPDX-License-Identifier: BSD-3-Clause
"""Concurrent clients with requests whose responses are known; see `stress`."""

from __future__ import annotations

import itertools
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import numpy as np
import rosgraph
import rospy
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    RobotState,
)

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_stress_world import IndependentChecker, World, gone, touched_bodies
from modular_framework_testing.planning.planning_wire import (
    ARM,
    LAUNCH,
    OK,
    START,
    FakeArm,
    box,
    joint_goal,
    plan,
    request,
)

CHANGE_PERIOD_S = 0.1
ANSWER_TIMEOUT_S = 40.0
PAN = ARM[0]
WAY = -1.2  # [rad] rotation of the shoulder in requests with a separate wall
SIZE = (0.08, 0.08, 0.3)
IN_COLLISION = MoveItErrorCodes.GOAL_IN_COLLISION
TIMED_OUT = (MoveItErrorCodes.TIMED_OUT, MoveItErrorCodes.PLANNING_FAILED)
FLIPPER = "flipper"  # the client that changes the scene continuously


@dataclass(frozen=True)
class Answer:
    """A response: period in which its scene was in force, own walls, expected and actual code."""

    begun: float
    ended: float
    code: int
    wanted: int
    points: np.ndarray
    walls: tuple[CollisionObject, ...]
    kind: str


def wall_at(turn: float, name: str) -> CollisionObject:
    """Returns a box that the forearm hits when the shoulder is this far from the start [rad]."""
    x, y = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ [-0.11, 0.46]
    return box(name, float(x), float(y), 1.3, SIZE)


class Clients:
    """Clients of move_group, one thread each."""

    def __init__(self, world: World, seconds: float) -> None:
        self._world, self._end = world, time.monotonic() + seconds
        self.answers: list[Answer] = []
        self.errors: list[str] = []
        self._numbers = itertools.count()

    def run(self, clients: int) -> int:
        """Runs the clients until the end of the time; returns the number of clients that got no response."""
        kinds = [self._ask_action, self._prove, self._prove]
        works = [self._change, *(kinds[: max(0, clients - 1)]), *[self._ask_service] * max(1, clients - len(kinds))]
        threads = [
            threading.Thread(target=self._guard, args=(work, number), daemon=True) for number, work in enumerate(works)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(max(0.0, self._end - time.monotonic()) + ANSWER_TIMEOUT_S)
        return sum(thread.is_alive() for thread in threads)

    def _guard(self, work: Callable[[int], None], number: int) -> None:
        try:
            while time.monotonic() < self._end:
                work(number)
        except Exception as error:  # noqa: BLE001 - whatever ends a client is a finding
            self.errors.append(f"{work.__name__}: {type(error).__name__}: {error}")

    def _change(self, _: int) -> None:
        """Moves a box between two positions, at fixed times."""
        places = {"flip": wall_at(0.7, "flip"), "flop": wall_at(1.0, "flop")}
        self._world.change(FLIPPER, places["flop"])
        due = time.monotonic()
        for here, there in itertools.cycle((("flip", "flop"), ("flop", "flip"))):
            due = max(due + CHANGE_PERIOD_S, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))
            if due >= self._end:
                return
            self._world.change(FLIPPER, places[here], gone(there))

    def _note(
        self,
        begun: float,
        response: Any,
        wanted: int,
        walls: tuple[CollisionObject, ...],
        kind: str,
        *,
        trajectory: Any,
    ) -> None:
        points = np.array([point.positions for point in trajectory.joint_trajectory.points], dtype=float)
        self.answers.append(Answer(begun, time.monotonic(), response.error_code.val, wanted, points, walls, kind))

    def _question(self) -> tuple[tuple[CollisionObject, ...], int, str]:
        """Returns the walls of a request and the expected code."""
        number = next(self._numbers)
        kind = ("no wall", "wall on the way", "wall at the goal")[number % 3]
        turn = {"wall on the way": WAY / 2, "wall at the goal": WAY}.get(kind)
        walls = () if turn is None else (wall_at(turn, f"own{number}"),)
        return walls, IN_COLLISION if kind == "wall at the goal" else OK, kind

    def _ask_service(self, _: int) -> None:
        """Requests a plan by the service; the wall is attached to the base of the start state."""
        walls, wanted, kind = self._question()
        state = RobotState(
            is_diff=True,
            attached_collision_objects=[
                AttachedCollisionObject(link_name="base_link", object=wall, touch_links=["base_link"]) for wall in walls
            ],
        )
        begun = time.monotonic()
        response = plan(request(joint_goal(PAN, START[0] + WAY), start_state=state, allowed_planning_time=20.0))
        self._note(begun, response, wanted, walls, f"service, {kind}", trajectory=response.trajectory)

    def _ask_action(self, _: int) -> None:
        """Requests plans by the action; the wall is in planning_scene_diff."""
        client = SteadyActionClient("move_group", MoveGroupAction)
        assert client.wait_for_server(rospy.Duration(10.0))
        while time.monotonic() < self._end:
            walls, wanted, kind = self._question()
            goal = MoveGroupGoal(request=request(joint_goal(PAN, START[0] + WAY), allowed_planning_time=20.0))
            goal.planning_options.plan_only = True
            goal.planning_options.planning_scene_diff.is_diff = True
            goal.planning_options.planning_scene_diff.robot_state.is_diff = True
            goal.planning_options.planning_scene_diff.world.collision_objects = list(walls)
            begun = time.monotonic()
            client.send_goal(goal)
            assert client.wait_for_result(rospy.Duration(ANSWER_TIMEOUT_S)), "no result of the action"
            result = client.get_result()
            self._note(begun, result, wanted, walls, f"action, {kind}", trajectory=result.planned_trajectory)

    def _prove(self, number: int) -> None:
        """Checks that a wall at the goal, and then its removal, are in force after the scene service responds."""
        name, turn = f"proof{number}", 1.8 + 0.6 * (number % 2)
        for wanted, message in ((IN_COLLISION, wall_at(turn, name)), (OK, gone(name))):
            self._world.change(name, message)
            begun = time.monotonic()
            response = plan(request(joint_goal(PAN, START[0] + turn), allowed_planning_time=20.0))
            self._note(begun, response, wanted, (), "scene changed just before", trajectory=response.trajectory)


class Judge:
    """Judges responses with a checker that shares no code with the planner."""

    def __init__(self, checker: IndependentChecker, rest: dict[str, float], step: float) -> None:
        """Checks that the straight motion is free without a wall and collides with a wall.

        Args:
            checker: Second checker of the robot.
            rest: Positions of the joints that are not planned for, by name [rad or m].
            step: Maximum difference of a joint between checked states [rad].
        """
        self._checker, self._rest, self._step = checker, rest, step
        line, wall = np.array([START, [START[0] + WAY, *START[1:]]]), wall_at(WAY / 2, "wall")
        assert not self._touched_objects(line, {}) and self._touched_objects(line, {"wall": wall}) == {"wall"}

    def _touched_objects(self, points: np.ndarray, objects: dict[str, CollisionObject]) -> set[str]:
        return touched_bodies(self._checker, ARM, points, self._rest, objects, step=self._step)

    def fault(self, answer: Answer, world: World) -> str:
        """Returns the fault of a response; "" without a fault."""
        if answer.code in TIMED_OUT and answer.wanted == OK:
            return ""  # counted as timeouts: slow, but not wrong
        if answer.code != answer.wanted:
            return f"{answer.kind}: code {answer.code} instead of {answer.wanted}"
        if answer.code != OK:
            return ""
        if not np.allclose(answer.points[0], START, atol=1e-6):
            return f"{answer.kind}: does not begin where the robot is"
        objects = world.objects_between(answer.begun, answer.ended)
        touched = self._touched_objects(answer.points, objects | {item.id: item for item in answer.walls})
        if touched - objects.keys():
            return f"{answer.kind}: the motion touches {', '.join(sorted(touched - objects.keys()))}"
        if not world.was_free_of(touched, answer.begun, answer.ended):
            return f"{answer.kind}: the motion touches something in every scene it may have been planned in"
        return ""


class MemoryWatch:
    """Samples the resident memory of move_group once a second."""

    def __init__(self) -> None:
        uri = rosgraph.Master("/stress").lookupNode("/move_group")
        self._status = Path(f"/proc/{ServerProxy(uri).getPid('/stress')[2]}/status")
        self.samples: list[tuple[float, float]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.wait(1.0):
            line = next(item for item in self._status.read_text().splitlines() if item.startswith("VmRSS"))
            self.samples.append((time.monotonic(), float(line.split()[1]) / 1024.0))

    def tenths(self) -> list[float]:
        """Returns memory after each tenth of the time [MB]."""
        return [round(self.samples[int(place)][1], 1) for place in np.linspace(0, len(self.samples) - 1, 11)]

    def stop(self) -> tuple[float, float, float]:
        """Returns memory at a quarter of the time and at the end [MB], and the slope between [MB/min]."""
        self._over.set()
        self._thread.join(5.0)
        late = np.array(self.samples[len(self.samples) // 4 :])
        slope = float(np.polyfit(late[:, 0], late[:, 1], 1)[0]) * 60.0 if len(late) > 2 else 0.0
        return float(late[0, 1]), float(late[-1, 1]), slope


def stress(session: Any, seconds: float, clients: int = 8, step: float = 0.02) -> dict[str, Any]:
    """Starts move_group, runs the clients, and judges every response afterwards.

    Args:
        session: Running `RosSession`.
        seconds: Duration of the requests [s].
        clients: Number of planning clients; one more client changes the scene.
        step: Maximum difference of a joint between checked states [rad].

    Returns:
        Figures: plans, wrong, timeouts, unanswered, scene_changes (of all clients), flips_per_s (of the client that
        attempts ten), rss_*_mb, wrong_answers (sentences), ...
    """
    session.launch(LAUNCH)
    session.wait_for_service("plan_kinematic_path", 120.0)
    arm = FakeArm()
    time.sleep(0.5)
    world = World()
    world.change("crate", box("crate", 0.0, -0.6, 1.0, (0.3, 0.3, 0.3)))
    plan(request(joint_goal(PAN, START[0] + 0.1)))  # objects that are made on first use are made now
    memory, asking = MemoryWatch(), Clients(world, seconds)
    unanswered = asking.run(clients)
    rss_start, rss_end, slope = memory.stop()
    judge = Judge(robot_checker(), {name: value for name, value in arm.positions.items() if name not in ARM}, step)
    arm.close()
    wrong = [text for answer in asking.answers if (text := judge.fault(answer, world))]
    took = sorted(item.ended - item.begun for item in asking.answers)
    flips = world.histories[FLIPPER]
    return {
        "seconds": seconds,
        "clients": clients,
        "plans": len(asking.answers),
        "motions_checked": sum(item.code == OK for item in asking.answers),
        "kinds": dict(Counter(item.kind for item in asking.answers)),
        "wrong": len(wrong) + len(asking.errors),
        "timeouts": sum(item.code in TIMED_OUT for item in asking.answers),
        "unanswered": unanswered,
        "scene_changes": sum(map(len, world.histories.values())),
        "flips_per_s": round(len(flips) / seconds, 2),
        "change_median_ms": round(1000.0 * float(np.median([item.ended - item.begun for item in flips])), 1),
        "change_max_ms": round(1000.0 * max(item.ended - item.begun for item in flips), 1),
        "median_ms": round(1000.0 * took[len(took) // 2], 1) if took else None,
        "rss_start_mb": round(rss_start, 1),
        "rss_end_mb": round(rss_end, 1),
        "rss_mb_per_min": round(slope, 2),
        "rss_mb_every_tenth": memory.tenths(),
        "wrong_answers": wrong[:10] + asking.errors[:10],
    }


def robot_checker() -> IndependentChecker:
    """Returns the second checker of the robot on the parameter server."""
    from modular_framework_planning.robot_model.urdf_document import package_resolver

    return IndependentChecker(
        str(rospy.get_param("robot_description")), str(rospy.get_param("robot_description_semantic")), package_resolver
    )
