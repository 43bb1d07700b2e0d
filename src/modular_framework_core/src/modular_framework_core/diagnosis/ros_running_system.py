# SPDX-License-Identifier: BSD-3-Clause
"""Checks of the running nodes, as a client sees them."""

from __future__ import annotations

import math
import threading
from collections.abc import Container, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from moveit_msgs.srv import GetStateValidity, GetStateValidityRequest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from modular_framework_core.diagnosis.findings import Finding, fault, note, ok
from modular_framework_planning.trajectory_execution.controllers import ACTION_KINDS, FAKE_KINDS, parse_controllers
from modular_framework_ros.calls import CallError, is_advertised, request_service, wait_until
from modular_framework_ros.connections.ros_frozen_nodes import frozen_nodes
from modular_framework_ros.connections.ros_node_calls import NodeCallError, node_address, process_id
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

ANSWER_TIMEOUT_S, MESSAGE_TIMEOUT_S, SERVICE_TIMEOUT_S = 3.0, 3.0, 10.0
FROZEN_TIMEOUT_S = 8.0
"""Longer than the watch for frozen nodes needs [s]."""
DIAGNOSTICS_S, STALE_S = 2.2, 1.0
CONTROLLER_LISTS = ("/move_group/controller_list", "controller_list")


def running_findings() -> Iterator[Finding]:
    """Yields the findings about the nodes of the ROS master; the caller is a node of this master."""
    publishers, subscribers, services = map(dict, rosgraph.Master(rospy.get_name()).getSystemState())
    yield from _nodes(
        {name for kind in (publishers, subscribers, services) for nodes in kind.values() for name in nodes}
    )
    yield from _clock()
    yield from _joint_states()
    yield from _controllers(publishers)
    yield from _start_state()
    yield from _diagnostics()


def is_master_running() -> bool:
    """Returns whether the ROS master of this shell runs."""
    return bool(rosgraph.is_master_online())


def _nodes(nodes: Iterable[str]) -> Iterator[Finding]:
    names = sorted({*nodes} - {rospy.get_name()})
    with ThreadPoolExecutor(len(names) or 1) as pool:
        silent = [name for name, answers in zip(names, pool.map(_answers, names), strict=True) if not answers]
    if not silent:
        yield ok(f"All {len(names)} nodes answer.")
        return
    frozen_nodes()  # starts the watch
    wait_until(lambda: frozen_nodes() != "", FROZEN_TIMEOUT_S)
    if frozen_nodes():
        yield fault(f"{frozen_nodes()}.", "resume the process, or restart the framework", "start")
    for name in silent:
        if f"'{name}'" not in frozen_nodes():
            yield fault(
                f"Node {name} does not answer, but the master still lists it.",
                "read its last lines in the log; after its end, rosnode cleanup removes the entry",
                "start",
            )


def _answers(name: str) -> bool:
    try:
        return process_id(node_address(name), ANSWER_TIMEOUT_S) > 0
    except NodeCallError:
        return False


def _clock() -> Iterator[Finding]:
    if not rospy.get_param("/use_sim_time", False):
        yield ok("Nodes use the time of the computer.")
        return
    clock: list[Clock] = []
    subscriber = rospy.Subscriber("/clock", Clock, clock.append, queue_size=10)
    advances = wait_until(lambda: len(clock) > 1 and clock[-1].clock > clock[0].clock, MESSAGE_TIMEOUT_S)
    subscriber.unregister()
    if advances:
        yield ok(f"The simulated time advances; it is {clock[-1].clock.to_sec():.1f} s.")
    elif clock:
        yield note(
            f"The simulated time stands still at {clock[-1].clock.to_sec():.1f} s, so that all motions wait.",
            "rosservice call /gazebo/unpause_physics, unless an episode holds the time",
            "start",
        )
    else:
        yield fault(
            "The parameter /use_sim_time is true, but no node publishes /clock.",
            "start the simulation, or delete the parameter",
            "start",
        )


def _joint_states() -> Iterator[Finding]:
    try:
        robot = read_urdf(str(rospy.get_param("robot_description", "")), "robot_description")
    except XmlError:
        yield fault(
            "The parameter robot_description has no valid robot description.",
            "start the framework by start_framework.launch",
            "start",
        )
        return
    wanted = {joint.name for joint in robot.joints if joint.is_movable and joint.mimic is None}
    positions: dict[str, float] = {}
    stamps: list[rospy.Time] = []

    def take(message: JointState) -> None:
        positions.update(zip(message.name, message.position, strict=False))
        stamps.append(message.header.stamp)

    subscriber = rospy.Subscriber("joint_states", JointState, take, queue_size=10)
    wait_until(lambda: wanted <= positions.keys(), MESSAGE_TIMEOUT_S)
    subscriber.unregister()
    missing = sorted(wanted - positions.keys())
    invalid = sorted(name for name, position in positions.items() if not math.isfinite(position))
    if missing:
        yield fault(
            f"The joint states lack {len(missing)} of {len(wanted)} joints: {', '.join(missing)}.",
            "look for a controller or hardware that did not start in the findings below, and for its error in the log",
            "robot",
        )
    if invalid:
        yield fault(
            f"Joint states are not numbers: {', '.join(invalid)}.", "stop the robot and restart its driver", "robot"
        )
    if stamps and abs((rospy.Time.now() - stamps[-1]).to_sec()) > STALE_S:
        age_s = (rospy.Time.now() - stamps[-1]).to_sec()
        yield fault(
            f"The last joint states are {age_s:.1f} s old.",
            "compare the clocks of the computers of this master",
            "robot",
        )
    if not missing and not invalid:
        yield ok(f"The states of all {len(wanted)} joints arrive.")


def _controllers(topics: Container[str]) -> Iterator[Finding]:
    listed: Any = next(filter(None, (rospy.get_param(name, None) for name in CONTROLLER_LISTS)), [])
    controllers, _ = parse_controllers(listed, (*ACTION_KINDS, *FAKE_KINDS), FAKE_KINDS[0])  # move_group logs faults
    actions = [rospy.resolve_name(item.action) for item in controllers if item.kind in ACTION_KINDS]
    missing = [action for action in actions if f"{action}/status" not in topics]
    for action in missing:
        yield fault(
            f"move_group sends motions to the action {action}, which no node offers.",
            "rosservice call /controller_manager/list_controllers; the spawner's error is in the log",
            "planning",
        )
    if actions and not missing:
        yield ok(f"All {len(actions)} controllers of move_group are available.")


def _start_state() -> Iterator[Finding]:
    if not is_advertised("check_state_validity"):
        yield fault("The node move_group does not run.", "start the framework by start_framework.launch", "planning")
        return
    request = GetStateValidityRequest()
    request.robot_state.is_diff = True
    try:
        answer = request_service("check_state_validity", GetStateValidity, request, SERVICE_TIMEOUT_S)
    except CallError as error:
        yield fault(
            f"move_group does not check the state of the robot: {error}.", "read the log of move_group", "planning"
        )
        return
    if answer.valid:
        yield ok("The robot is within its limits and touches nothing, as move_group sees it.")
        return
    pairs = sorted({" and ".join(sorted((item.contact_body_1, item.contact_body_2))) for item in answer.contacts})
    cause = f"these touch: {'; '.join(pairs)}" if pairs else "a joint is out of bounds; the log of move_group names it"
    yield fault(
        f"Plans cannot start here, as move_group sees the robot: {cause}.",
        "move the robot by hand or by its controller, or remove a wrong object from the planning scene",
        "planning",
    )


def _diagnostics() -> Iterator[Finding]:
    latest: dict[str, DiagnosticStatus] = {}
    lock = threading.Lock()

    def take(message: DiagnosticArray) -> None:
        with lock:
            latest.update({status.name: status for status in message.status})

    subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, take, queue_size=10)
    wait_until(lambda: False, DIAGNOSTICS_S)  # each device publishes once a second
    subscriber.unregister()
    with lock:
        statuses = list(latest.values())
    for status in statuses:
        text = f"{status.name}: {status.message}."
        if status.level >= DiagnosticStatus.ERROR:
            yield fault(text, "see the table of faults of the device", "robot")
        elif status.level == DiagnosticStatus.WARN:
            yield note(text, anchor="robot")
    if statuses and all(status.level == DiagnosticStatus.OK for status in statuses):
        yield ok(f"{len(statuses)} devices report no fault on /diagnostics.")
