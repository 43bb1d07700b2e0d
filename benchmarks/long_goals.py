# SPDX-License-Identifier: BSD-3-Clause
"""Goals of very many points, sent to a running trajectory controller: what they do to its loop and to a cancel.

A motion is under way. A client in another process sends a goal of 100,000 points, valid or not, and cancels the motion
10 ms after it began to send the goal. Noted are how late the cycles of the loop began from then until the goal was
answered, and how long after the cancel the client learned that the motion has ended. No cycle may begin more than 2 ms
late, and every cancel must take effect within 20 ms: the bars hold for the maximum over all repetitions.

A goal of ten points shows what the machine does without such goals. Beside the figures are the longest time for which
the loop had no processor, the longest time for which a witness had none (see `processor_witness.py`), the time that the
host kept for other machines, and the load: they distinguish a late loop from a busy machine.
"""

from __future__ import annotations

import io
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from processor_witness import Witnesses, longest_s

POINTS = 100_000
STEP_S = 1e-3
CANCEL_DELAY_S = 0.01
ANSWER_S = 60.0
WATCHED_S = 3.0  # from the goal on, also where the answer comes at once: a busy machine is late now and then
MAX_LATE_S = 2e-3  # of a cycle, while such a goal is received, checked and followed
MAX_CANCEL_S = 0.02
NOISE = "ten points, refused"


@dataclass(frozen=True, slots=True)
class LostTime:
    """Processor time that neither the loop nor its client got.

    Attributes:
        loop_ms: Longest time for which the loop was due without a processor [ms].
        witness_ms: Longest time for which a witness had no processor [ms]; None without permission for real time.
        stolen_s: Processor time that the host of this machine kept for others [s].
        load: Load of the machine, 1 minute.
    """

    loop_ms: float
    witness_ms: float | None
    stolen_s: float
    load: float


@dataclass(frozen=True, slots=True)
class LongGoalFigures:
    """Figures of one kind of goal over all repetitions.

    Attributes:
        kind: of the goal.
        late_ms: how late the latest cycle of each repetition began, ascending [ms].
        cancel_ms: how long after its cancel the motion ended, in each repetition, ascending [ms].
        answer_s: how long the controller took to accept or refuse the goal, at most [s].
        lost: processor time that was lost meanwhile.
    """

    kind: str
    late_ms: list[float]
    cancel_ms: list[float]
    answer_s: float
    lost: LostTime

    def faults(self) -> list[str]:
        """Returns the violated bars, with the time that the machine lost."""
        lost = self.lost
        beside = (
            f"without a processor: loop {lost.loop_ms:.1f} ms, "
            f"witness {'unknown' if lost.witness_ms is None else f'{lost.witness_ms:.1f} ms'}; "
            f"the host kept {lost.stolen_s:.2f} s; load {lost.load:.1f}"
        )
        return [
            f"{self.kind}: {name} {values[-1]:.1f} ms, allowed {1e3 * limit_s:g} ms ({beside})"
            for name, values, limit_s in (
                ("a cycle began late by", self.late_ms, MAX_LATE_S),
                ("a cancel took", self.cancel_ms, MAX_CANCEL_S),
            )
            if values[-1] > 1e3 * limit_s
        ]

    def row(self) -> str:
        """One line of the table."""

        def three(values: list[float]) -> str:
            middle, high = values[len(values) // 2], values[min(len(values) - 1, round(0.9 * (len(values) - 1)))]
            return f"{middle:8.2f} {high:8.2f} {values[-1]:8.2f}"

        lost = self.lost
        witness = "-" if lost.witness_ms is None else f"{lost.witness_ms:.2f}"
        return (
            f"{self.kind:22} {three(self.late_ms)}  {three(self.cancel_ms)}  {self.answer_s:8.2f} "
            f"{lost.loop_ms:8.2f} {witness:>8} {lost.stolen_s:8.2f} {lost.load:6.1f}"
        )


HEADER = (
    f"{f'{POINTS} points, {POINTS * STEP_S:g} s':22} {'latest cycle [ms]':>26}  {'cancel to end [ms]':>26}  "
    f"{'answer':>8} {'no processor [ms]':>17} {'stolen':>8} {'load':>6}\n{'':22} {'p50':>8} {'p90':>8} {'max':>8}  "
    f"{'p50':>8} {'p90':>8} {'max':>8}  {'[s]':>8} {'loop':>8} {'witness':>8} {'[s]':>8}"
)


def kinds_of_goals(joints: list[str]) -> dict[str, bytes]:
    """Serialised goals, by kind."""
    import rospy
    from control_msgs.msg import FollowJointTrajectoryActionGoal
    from trajectory_msgs.msg import JointTrajectoryPoint

    def serialised(change: Callable[[Any], None]) -> bytes:
        message = FollowJointTrajectoryActionGoal()
        message.goal_id.id = "long"
        trajectory = message.goal.trajectory
        trajectory.joint_names = list(joints)
        zeros = [0.0] * len(joints)
        for number in range(POINTS):
            trajectory.points.append(
                JointTrajectoryPoint(zeros, zeros, zeros, [], rospy.Duration.from_sec(STEP_S * (number + 1)))
            )
        change(trajectory)
        buffer = io.BytesIO()
        message.serialize(buffer)
        return buffer.getvalue()

    def drop_velocities(trajectory: Any) -> None:
        for point in trajectory.points:
            point.velocities, point.accelerations = [], []

    def spoil_every_point(trajectory: Any) -> None:
        for point in trajectory.points:
            point.positions = [float("nan")] * len(joints)

    def stop_time(trajectory: Any) -> None:
        for point in trajectory.points:
            point.time_from_start = rospy.Duration(1)

    def spoil_ten_points(trajectory: Any) -> None:
        del trajectory.points[10:]
        spoil_every_point(trajectory)

    return {
        NOISE: serialised(spoil_ten_points),
        "valid, quintic": serialised(lambda trajectory: None),
        "valid, linear": serialised(drop_velocities),
        "beyond the limits": serialised(
            lambda trajectory: [setattr(point, "positions", [9.0] * len(joints)) for point in trajectory.points]
        ),
        "not a number": serialised(spoil_every_point),
        "times do not increase": serialised(stop_time),
        "unknown joint": serialised(lambda trajectory: trajectory.joint_names.append("none")),
    }


@dataclass(frozen=True, slots=True)
class _Once:
    """Figures of one goal: latest cycle, time of the loop without a processor, cancel and answer [s]."""

    late_s: float
    no_processor_s: float
    cancel_s: float
    answer_s: float


class LongGoalBench:
    """Sends such goals to the controller `name`; a node is initialised and the controller runs."""

    def __init__(self, name: str, joints: list[str]) -> None:
        import rospy
        from actionlib import ActionClient
        from actionlib_msgs.msg import GoalID, GoalStatusArray
        from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryActionGoal

        class RawGoal(FollowJointTrajectoryActionGoal):
            """A goal that is sent as the bytes it was made of."""

            _raw = b""

            def serialize(self, buff: Any) -> None:
                buff.write(self._raw)

        self._raw_class = RawGoal
        self._joints = joints
        topic = f"{name}/follow_joint_trajectory"
        self._client = ActionClient(topic, FollowJointTrajectoryAction)
        if not self._client.wait_for_server(rospy.Duration(20.0)):
            raise RuntimeError(f"waited 20 s for {topic} in vain")
        self._goals = rospy.Publisher(f"{topic}/goal", RawGoal, queue_size=1)
        self._cancels = rospy.Publisher(f"{topic}/cancel", GoalID, queue_size=1)
        self._answered, self._name = threading.Event(), ""
        self._sent = 0
        rospy.Subscriber(f"{topic}/status", GoalStatusArray, self._on_status)
        while self._goals.get_num_connections() == 0 or self._cancels.get_num_connections() == 0:
            time.sleep(0.05)

    def _on_status(self, message: Any) -> None:
        if any(status.goal_id.id == self._name and status.status != 0 for status in message.status_list):
            self._answered.set()

    def run(self, kind: str, goal: bytes, repetitions: int) -> LongGoalFigures:
        """Sends a goal some times."""
        late_ms, cancel_ms, answers_s, lost_ms = [], [], [], []
        witnesses, stolen_before_s = Witnesses(), stolen_s()
        for _ in range(repetitions):
            self._sent += 1
            once = self._once(goal, f"{self._sent:04}")
            late_ms.append(1e3 * once.late_s)
            cancel_ms.append(1e3 * once.cancel_s)
            answers_s.append(once.answer_s)
            lost_ms.append(1e3 * once.no_processor_s)
        taken = witnesses.taken()
        witness_ms = None if taken is None else 1e3 * max(map(longest_s, taken))
        lost = LostTime(max(lost_ms), witness_ms, stolen_s() - stolen_before_s, os.getloadavg()[0])
        return LongGoalFigures(kind, sorted(late_ms), sorted(cancel_ms), max(answers_s), lost)

    def _once(self, goal: bytes, name: str) -> _Once:
        import rospy
        from actionlib import CommState
        from actionlib_msgs.msg import GoalID
        from control_msgs.msg import FollowJointTrajectoryGoal
        from std_srvs.srv import Empty
        from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

        ended, ended_s = threading.Event(), [0.0]

        def on_transition(handle: Any) -> None:
            if handle.get_comm_state() in (CommState.WAITING_FOR_RESULT, CommState.DONE) and not ended_s[0]:
                ended_s[0] = time.monotonic()
                ended.set()

        point = JointTrajectoryPoint([0.4] * len(self._joints), [], [], [], rospy.Duration(20))
        trajectory = JointTrajectory(joint_names=self._joints, points=[point])
        motion = self._client.send_goal(FollowJointTrajectoryGoal(trajectory=trajectory), on_transition)
        deadline_s = time.monotonic() + ANSWER_S
        while motion.get_comm_state() != CommState.ACTIVE:
            if motion.get_comm_state() == CommState.DONE or time.monotonic() > deadline_s:
                raise RuntimeError(f"the motion did not begin: {motion.get_goal_status_text()}")
            time.sleep(0.01)
        message = self._raw_class()
        # the id "long" is replaced by another one of the same length
        self._name = name
        message._raw = goal.replace(b"long", name.encode(), 1)
        self._answered.clear()
        time.sleep(0.3)
        rospy.ServiceProxy("robot_hw/reset_statistics", Empty)()
        sent_s = time.monotonic()
        sender = threading.Thread(target=self._goals.publish, args=(message,))
        sender.start()
        time.sleep(max(0.0, sent_s + CANCEL_DELAY_S - time.monotonic()))
        canceled_s = time.monotonic()
        motion.cancel()
        if not ended.wait(ANSWER_S) or not self._answered.wait(ANSWER_S):
            raise RuntimeError(f"no answer to a goal of {POINTS} points, or to a cancel, within {ANSWER_S:g} s")
        answered_s = time.monotonic()
        time.sleep(max(0.2, sent_s + WATCHED_S - answered_s))
        late_s, no_processor_s = loop_lateness_s()
        self._cancels.publish(GoalID(id=name))
        sender.join()
        return _Once(late_s, no_processor_s, ended_s[0] - canceled_s, answered_s - sent_s)


def loop_lateness_s() -> tuple[float, float]:
    """Returns the longest delay of a cycle and the longest time without a processor since the last reset [s]."""
    import rospy
    from diagnostic_msgs.msg import DiagnosticArray

    status = rospy.wait_for_message("/diagnostics", DiagnosticArray, 10.0).status[0]
    values = {value.key: value.value for value in status.values}
    return float(values["late_max_us"]) * 1e-6, float(values["no_processor_max_us"]) * 1e-6


def stolen_s() -> float:
    """Processor time that the host of this machine took away so far [s]."""
    return int(Path("/proc/stat").read_text().split()[8]) / os.sysconf("SC_CLK_TCK")
