# SPDX-License-Identifier: BSD-3-Clause
"""Gains of running controllers, adjusted by dynamic_reconfigure as rqt_reconfigure does it."""

from __future__ import annotations

import math
from typing import Any

import pytest
import rosgraph
import rospy
from control_msgs.msg import JointControllerState
from controller_manager_msgs.srv import LoadController, SwitchController, UnloadController
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_testing.ros_session import until

CONTROLLERS = ["states", "push", "lift", "grip", "pair"]


def call(name: str, kind: Any, *arguments: Any) -> Any:
    rospy.wait_for_service(f"controller_manager/{name}", 60.0)
    return rospy.ServiceProxy(f"controller_manager/{name}", kind)(*arguments)


def gains_of(client: Client) -> dict[str, Any]:
    configuration: dict[str, Any] = client.get_configuration(30.0)
    return {key: value for key, value in configuration.items() if key != "groups"}


@pytest.fixture(scope="module", autouse=True)
def robot(ros_session: Any) -> Any:
    for name in CONTROLLERS:
        assert call("load_controller", LoadController, name).ok, name
    assert call("switch_controller", SwitchController, CONTROLLERS, [], 2, False, 0.0).ok
    return ros_session


@pytest.mark.parametrize(
    ("server", "gains"),
    [
        ("push/pid", (5.0, 1.0, 0.0, -0.5, 0.5, False)),
        ("lift/gains/rail", (5.0, 0.0, 0.0, -2.0, 0.0, True)),
        ("grip/gains/finger", (10.0, 0.0, 0.0, 0.0, 0.0, False)),
        ("pair/a/pid", (10.0, 0.0, 0.0, 0.0, 0.0, False)),
        ("pair/b/pid", (20.0, 0.0, 1.0, 0.0, 0.0, False)),
    ],
)
def test_each_joint_with_gains_has_a_server_that_begins_with_its_parameters(
    server: str, gains: tuple[Any, ...]
) -> None:
    names = ("p", "i", "d", "i_clamp_min", "i_clamp_max", "antiwindup")
    assert gains_of(Client(server, timeout=30.0)) == dict(zip(names, gains, strict=True))


def test_adjusted_gains_are_those_of_the_next_cycles_and_of_the_parameter_server() -> None:
    states: list[JointControllerState] = []
    subscriber = rospy.Subscriber("push/state", JointControllerState, states.append)
    client = Client("push/pid", timeout=30.0)
    applied = client.update_configuration({"p": 2.0, "i": 0.0, "d": 5000.0, "i_clamp_max": -3.0, "antiwindup": True})
    assert (applied["p"], applied["d"], applied["i_clamp_max"]) == (2.0, 1000.0, 0.0), "within control_toolbox's ranges"
    client.update_configuration({"d": 0.0})
    until(lambda: states and (states[-1].p, states[-1].d) == (2.0, 0.0), "a state with the new gains")
    command = rospy.Publisher("push/command", Float64, queue_size=1, latch=True)
    command.publish(0.2)
    until(lambda: states[-1].set_point == 0.2 and abs(states[-1].error) > 0.01, "the slide on its way")
    assert states[-1].command == pytest.approx(2.0 * states[-1].error, abs=1e-9)
    assert states[-1].antiwindup and rospy.get_param("push/pid/p") == 2.0
    subscriber.unregister()


def test_a_gain_that_is_no_number_is_refused_and_named(robot: Any) -> None:
    client = Client("lift/gains/rail", timeout=30.0)
    for number in (math.nan, math.inf):
        assert client.update_configuration({"p": number})["p"] == 5.0
    until(
        lambda: "/lift/gains/rail/p: got nan; allowed: -100000.0 to 100000.0; 5.0 stays" in robot.log(),
        "the reason in the log",
    )


def test_a_trajectory_stops_being_followed_when_its_gain_is_taken_away_and_goes_on_with_it() -> None:
    client = Client("lift/gains/rail", timeout=30.0)
    client.update_configuration({"p": 0.0})
    message = JointTrajectory(joint_names=["rail"], points=[JointTrajectoryPoint(positions=[0.1])])
    message.points[0].time_from_start = rospy.Duration(0.1)
    command = rospy.Publisher("lift/command", JointTrajectory, queue_size=1)
    until(command.get_num_connections, "lift/command has a subscriber")
    command.publish(message)
    positions: list[float] = []
    subscriber = rospy.Subscriber(
        "joint_states", JointState, lambda heard: positions.append(heard.position[heard.name.index("rail")])
    )
    until(lambda: len(positions) > 50, "fifty cycles")
    assert set(positions) == {0.0}
    client.update_configuration({"p": 20.0})
    until(lambda: abs(positions[-1] - 0.1) < 1e-3, "the rail at its goal")
    subscriber.unregister()


def test_the_servers_go_with_their_controller() -> None:
    assert call("switch_controller", SwitchController, [], ["pair"], 2, False, 0.0).ok
    assert call("unload_controller", UnloadController, "pair").ok
    publishers, _, services = rosgraph.Master("/test").getSystemState()
    assert not [name for name, _ in (*publishers, *services) if name.startswith("/pair/")]
    assert call("load_controller", LoadController, "pair").ok, "it can be loaded again"
