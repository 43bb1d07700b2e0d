# SPDX-License-Identifier: BSD-3-Clause
"""The command-line tools for controllers, run as a user runs them."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from controller_manager_msgs.msg import ControllersStatistics
from controller_manager_msgs.srv import ListControllers
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool

from modular_framework_testing.ros_session import executable


@pytest.fixture(scope="module")
def session(ros_session: Any) -> Any:
    return ros_session


@pytest.fixture(scope="module")
def tool(session: Any) -> Iterator[Callable[..., Any]]:
    started: list[subprocess.Popen[str]] = []

    def start(name: str, *arguments: str) -> subprocess.Popen[str]:
        command = [executable("controller_manager", name), *arguments]
        started.append(
            subprocess.Popen(command, env=session.env, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        )
        return started[-1]

    yield start
    for process in started:
        process.kill()


def run(process: subprocess.Popen[str]) -> tuple[int, str]:
    output, _ = process.communicate(timeout=60.0)
    return process.returncode, output


def states() -> dict[str, str]:
    rospy.wait_for_service("controller_manager/list_controllers", 60.0)
    reply = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)()
    return {entry.name: entry.state for entry in reply.controller}


def wait_until(expected: dict[str, str]) -> None:
    deadline = time.monotonic() + 60.0
    while states() != expected:
        assert time.monotonic() < deadline, states()
        time.sleep(0.05)


def test_the_spawner_waits_spawns_and_cleans_up_at_its_end(tool: Callable[..., Any], tmp_path: Path) -> None:
    names = tmp_path / "controllers.yaml"
    names.write_text("states: {}\narm: {}\nspare: {type: position_controllers/JointPositionController, joint: elbow}\n")
    process = tool("spawner", "--wait-for", "robot_ready", str(names))
    time.sleep(0.9)
    assert states() == {}
    ready = rospy.Publisher("robot_ready", Bool, queue_size=1, latch=True)
    ready.publish(True)
    wait_until({"states": "running", "arm": "running", "spare": "running"})
    process.send_signal(signal.SIGINT)
    assert process.wait(30.0) == 0
    assert states() == {}


def kill_node(session: Any, name: str) -> None:
    subprocess.run(["rosnode", "kill", name], env=session.env, check=True, timeout=60.0)


@pytest.mark.parametrize("how", ["SIGTERM", "rosnode kill"])
def test_spawner_and_unspawner_clean_up_however_they_are_ended(
    tool: Callable[..., Any], session: Any, how: str
) -> None:
    def end(process: subprocess.Popen[str], name: str) -> str:
        if how == "SIGTERM":
            process.send_signal(signal.SIGTERM)
        else:
            kill_node(session, name)
        code, output = run(process)
        assert code == 0 and "waited" not in output, output
        return output

    spawner = tool("spawner", "states", "arm", "__name:=my_spawner")
    wait_until({"states": "running", "arm": "running"})
    unspawner = tool("unspawner", "arm", "__name:=my_unspawner")
    wait_until({"states": "running", "arm": "stopped"})
    end(unspawner, "/my_unspawner")
    assert states() == {"states": "running", "arm": "running"}
    output = end(spawner, "/my_spawner")
    assert states() == {}
    for text in ("Shutting down spawner. Stopping and unloading controllers...", "Succeeded in unloading states"):
        assert text in output, output


def test_an_unspawner_keeps_controllers_stopped_and_starts_them_at_its_end(tool: Callable[..., Any]) -> None:
    unspawner = tool("unspawner", "arm")
    spawner = tool("spawner", "arm", "states")
    wait_until({"arm": "stopped", "states": "running"})
    assert run(tool("controller_manager", "start", "arm"))[0] == 0
    wait_until({"arm": "stopped", "states": "running"})
    unspawner.send_signal(signal.SIGTERM)
    assert unspawner.wait(30.0) == 0
    assert states() == {"arm": "running", "states": "running"}
    spawner.send_signal(signal.SIGINT)
    assert spawner.wait(30.0) == 0
    assert states() == {}


def test_a_spawner_starts_what_it_can_and_reports_what_it_cannot(tool: Callable[..., Any]) -> None:
    process = tool("spawner", "--timeout", "1", "--wait-for", "robot_awake", "states", "absent", "arm")
    awake = rospy.Publisher("robot_awake", Bool, queue_size=1, latch=True)
    for line in process.stdout:
        if "topic /robot_awake has not published True for 1 s" in line:
            break
    awake.publish(True)
    wait_until({"states": "running", "arm": "running"})
    process.send_signal(signal.SIGINT)
    code, output = run(process)
    assert code == 1 and states() == {}
    for text in (
        "Loading controller: states",
        "Failed to load absent",
        "Controller Spawner: Loaded controllers: states, arm",
        "Started controllers: states, arm",
        "not spawned: absent",
    ):
        assert text in output, output


def test_the_manager_tool_does_and_lists(tool: Callable[..., Any]) -> None:
    assert run(tool("controller_manager", "list")) == (0, "No controllers are loaded in mechanism control\n")
    assert run(tool("controller_manager", "spawn", "states")) == (
        0,
        "Loaded 'states'\nStarted ['states'] successfully\n",
    )
    code, output = run(tool("controller_manager", "list"))
    assert (code, output) == (0, "'states' - 'hardware_interface::JointStateInterface' ( running )\n")
    assert "position_controllers/JointTrajectoryController" in run(tool("controller_manager", "list-types"))[1]
    assert run(tool("controller_manager", "reload-libraries", "--restore"))[0] == 0
    assert states() == {"states": "running"}
    assert run(tool("controller_manager", "kl", "states")) == (
        0,
        "Stopped ['states'] successfully\nUnloaded 'states' successfully\n",
    )
    assert states() == {}


def test_groups_are_listed_started_and_exchanged(tool: Callable[..., Any]) -> None:
    assert run(tool("controller_group", "list")) == (
        0,
        "Number of groups: 3\n  clash\n      jog\n      arm\n  follow\n      states\n      arm\n"
        "  teach\n      states\n      jog\n",
    )
    assert run(tool("controller_group", "spawn", "follow")) == (
        0,
        "Loaded 'states'\nLoaded 'arm'\nStarted ['states'] successfully\nStarted ['arm'] successfully\n",
    )
    assert states() == {"states": "running", "arm": "running"}
    assert run(tool("controller_group", "switch", "teach")) == (
        0,
        "Loaded 'jog'\nStarted ['jog'] successfully\nStopped ['arm'] successfully\n",
    )
    assert states() == {"states": "running", "arm": "stopped", "jog": "running"}
    code, output = run(tool("controller_group", "switch", "clash"))
    assert code == 0 and "Error when starting ['arm'] and stopping ['states']\n" in output
    assert states() == {"states": "running", "arm": "stopped", "jog": "running"}
    code, output = run(tool("controller_group", "switch", "absent"))
    assert code == 1 and "known groups: clash, follow, teach" in output


def test_statistics_of_the_controllers_are_published(tool: Callable[..., Any]) -> None:
    message = rospy.wait_for_message("controller_manager/statistics", ControllersStatistics, 30.0)
    figures = {entry.name: entry for entry in message.controller}
    assert {name: entry.running for name, entry in figures.items()} == {"states": True, "arm": False, "jog": True}
    jog = figures["jog"]
    assert jog.type == "position_controllers/JointPositionController"
    assert 0.0 < jog.mean_time.to_sec() <= jog.max_time.to_sec() < 1.0
    assert message.header.stamp.to_sec() - 5.0 < jog.timestamp.to_sec() <= message.header.stamp.to_sec() + 1.0
    assert run(tool("controller_manager", "kill", "states"))[0] == 0


@pytest.mark.parametrize("patience", [("--no-timeout",), ("--timeout", "0")])
def test_a_spawner_that_waits_for_its_manager_can_be_ended(tool: Callable[..., Any], patience: tuple[str, ...]) -> None:
    process = tool("spawner", *patience, "--namespace", "/elsewhere", "arm")
    for line in process.stdout:
        if "Waiting for service /elsewhere/controller_manager/load_controller" in line:
            break
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(1.0)
    process.send_signal(signal.SIGINT)
    code, output = run(process)
    assert code == 1 and "ended while waiting for service /elsewhere" in output


def test_a_spawner_has_patience_with_a_simulation_whose_clock_has_not_begun(tool: Callable[..., Any]) -> None:
    rospy.set_param("/use_sim_time", True)
    try:
        process = tool("spawner", "--timeout", "1", "--namespace", "/elsewhere", "arm")
        for line in process.stdout:
            if "Waiting for service /elsewhere/controller_manager/load_controller" in line:
                break
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(3.0)
        clock = rospy.Publisher("/clock", Clock, queue_size=1, latch=True)
        clock.publish(Clock(rospy.Time(1)))
        code, output = run(process)
        clock.unregister()
    finally:
        rospy.delete_param("/use_sim_time")
    waited = re.search(r"waited (\d+) s for service /elsewhere/controller_manager/list_controllers in vain", output)
    assert code == 1 and waited is not None and int(waited[1]) >= 3, "what is said is how long it really waited"


def test_what_fails_is_named_and_is_the_exit_code(tool: Callable[..., Any]) -> None:
    processes = {
        "controller 'absent' was not loaded": tool("controller_manager", "load", "absent"),
        "name at least one controller": tool("controller_manager", "start"),
        "waited 1 s for service /elsewhere/controller_manager/list_controllers": tool(
            "spawner", "--timeout", "1", "--namespace", "/elsewhere", "arm"
        ),
    }
    for words, process in processes.items():
        code, output = run(process)
        assert code == 1
        assert words in output
