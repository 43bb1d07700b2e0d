# SPDX-License-Identifier: BSD-3-Clause
"""Measures the effect of a SIGINT during a simulated pick: end of the task, rest of the arm, remaining processes."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from modular_framework_core.launching.launch_session import processes_with
from modular_framework_testing.ros_session import Launch, RosSession

STOPPED_WITHIN_S = 1.0
AT_REST_RAD_S = 0.02
BY_ITSELF_S = 0.1
LAST_WORD = "ended with outcome"
START_TIMEOUT_S = 120.0
STOP_TIMEOUT_S = 30.0

# A node beside the launch: for each message of the joints the time [s, monotonic] and the fastest joint of the arm.
WATCHER = """
import os, sys, time
import rosgraph, rospy
from sensor_msgs.msg import JointState
while not rosgraph.is_master_online():
    time.sleep(0.05)
rospy.init_node("watcher_of_the_arm", disable_signals=True)
def write(message):
    speeds = [abs(speed) for name, speed in zip(message.name, message.velocity) if "ezgripper" not in name]
    if speeds:
        print(time.monotonic(), max(speeds), flush=True)
rospy.Subscriber("joint_states", JointState, write, queue_size=1, tcp_nodelay=True)
sys.stdin.read()
os._exit(0)
"""


@dataclass(frozen=True, slots=True)
class Stop:
    """The effect of one Ctrl-C.

    Attributes:
        moment_s: Time from the awaited text to the signal [s].
        state: Running state.
        speed: Speed of the fastest joint of the arm at the signal [rad/s].
        last_word_s: Time from the signal to the last line of the task [s].
        outcome: Last line of the task.
        rest_s: Time from the signal to the last message with a moving joint of the arm [s].
        last_speed: Speed of the fastest joint of the arm in the last message [rad/s].
        launch_s: Time from the signal to the end of the launch [s].
        slow: Lines of roslaunch about nodes that had to be killed.
        left: Command lines of the processes that the launch left behind.
    """

    moment_s: float
    state: str
    speed: float
    last_word_s: float
    outcome: str
    rest_s: float
    last_speed: float
    launch_s: float
    slow: tuple[str, ...]
    left: tuple[str, ...]

    def faults(self) -> list[str]:
        """Returns the violated requirements."""
        return [
            text
            for wrong, text in (
                (self.last_word_s > STOPPED_WITHIN_S, f"the last line came after {self.last_word_s:.2f} s"),
                ("'preempted'" not in self.outcome, f"it says '{self.outcome}'"),
                (self.last_speed > AT_REST_RAD_S, f"the arm was last seen moving at {self.last_speed:.3f} rad/s"),
                (self.rest_s > STOPPED_WITHIN_S, f"the arm stood after {self.rest_s:.2f} s"),
                (bool(self.slow), f"nodes had to be ended by force: {', '.join(self.slow)}"),
                (bool(self.left), f"these processes were left: {', '.join(self.left)}"),
            )
            if wrong
        ]

    def figures(self) -> dict[str, Any]:
        """Returns the attributes and the faults, for JSON."""
        return asdict(self) | {"faults": self.faults()}


def stop_a_pick(moment_s: float, after: str = "first state running", *, in_motion: bool = False) -> Stop | None:
    """Starts the framework, and sends SIGINT some time after a text in its log.

    Args:
        moment_s: Time from the text to the signal [s].
        after: Text in the log.
        in_motion: Whether the time begins only when the arm also moves, which may be late on a busy computer.

    Returns:
        The effect; None if the task ended before the signal, or by itself at the signal.
    """
    session = RosSession()
    session.env.pop("DISPLAY", None)
    speeds = session.folder / "speeds.txt"
    with speeds.open("w") as output:
        watcher = subprocess.Popen(
            [sys.executable, "-c", WATCHER], env=session.env, stdin=subprocess.PIPE, stdout=output
        )
    try:
        launch = session.run_framework(gui="false", rviz="false")
        _until(launch, after, START_TIMEOUT_S)
        if in_motion:
            _until_it_moves(launch, speeds)
        time.sleep(moment_s)
        if LAST_WORD in launch.log() or not launch.alive():
            _print_failure(launch.log())
            return None
        pressed = time.monotonic()
        os.killpg(launch.process.pid, signal.SIGINT)
        last_word_s = _until(launch, LAST_WORD, STOP_TIMEOUT_S) - pressed
        launch.wait(STOP_TIMEOUT_S)
        launch_s = time.monotonic() - pressed
        if last_word_s < BY_ITSELF_S and "SUCCEEDED" in launch.log():
            return None
        samples = _samples(speeds, pressed)
        return _stop(moment_s, launch.log(), samples, last_word_s, launch_s, left=_left(session, watcher.pid))
    finally:
        watcher.kill()
        watcher.wait()
        session.stop()


def _print_failure(log: str) -> None:
    """Prints why a pick ended before the signal, unless it succeeded."""
    if "SUCCEEDED" not in log:
        reasons = [line for line in log.splitlines() if line.startswith(("Task ", "  "))] or log.splitlines()[-20:]
        print("a pick failed by itself:", *reasons, sep="\n", file=sys.stderr, flush=True)


def _samples(speeds: Path, pressed: float) -> list[tuple[float, float]]:
    """Returns the times since the signal [s], and the speed of the fastest joint at each time [rad/s]."""
    rows = [line.split() for line in speeds.read_text().splitlines()]
    return [(float(row[0]) - pressed, float(row[1])) for row in rows if len(row) == 2]


def _stop(
    moment_s: float,
    log: str,
    samples: list[tuple[float, float]],
    last_word_s: float,
    launch_s: float,
    *,
    left: tuple[str, ...],
) -> Stop:
    moving = [time_s for time_s, speed in samples if speed > AT_REST_RAD_S and time_s > 0.0]
    last_word = next(line for line in log.splitlines() if LAST_WORD in line)
    running = [line.split("'")[5] for line in log.splitlines() if "state machine goes from" in line]
    return Stop(
        round(moment_s, 3),
        running[-1] if running else "the first",
        _speed_at(samples, 0.0),
        round(last_word_s, 3),
        last_word.strip(),
        round(moving[-1] if moving else 0.0, 3),
        samples[-1][1],
        round(launch_s, 3),
        tuple(line.strip() for line in log.splitlines() if "escalating to" in line),
        left,
    )


def _speed_at(samples: list[tuple[float, float]], time_s: float) -> float:
    return next((speed for at, speed in reversed(samples) if at <= time_s), 0.0)


def _until(launch: Launch, text: str, timeout_s: float) -> float:
    """Waits until a launch prints a text; returns the time of this moment [s, monotonic]."""
    end = time.monotonic() + timeout_s
    while text not in launch.log():
        assert time.monotonic() < end, f"'{text}' was not printed in {timeout_s} s:\n{launch.log()}"
        assert launch.alive() or text in launch.log(), launch.log()
        time.sleep(0.01)
    return time.monotonic()


def _until_it_moves(launch: Launch, speeds: Path) -> None:
    """Waits until the arm moves."""
    end = time.monotonic() + START_TIMEOUT_S
    while not [
        line
        for line in speeds.read_text().splitlines()[-2:]
        if len(line.split()) == 2 and float(line.split()[1]) > AT_REST_RAD_S
    ]:
        assert time.monotonic() < end and launch.alive(), f"the arm did not move:\n{launch.log()}"
        time.sleep(0.02)


def _left(session: RosSession, watcher: int) -> tuple[str, ...]:
    """Returns the command lines of the remaining processes of the session, without the watcher."""
    found = []
    for process in processes_with("ROS_MASTER_URI", session.env["ROS_MASTER_URI"]):
        with contextlib.suppress(OSError):  # the process has ended
            command = Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ")
            if process != watcher:
                found.append(command.decode(errors="replace").strip())
    return tuple(found)
