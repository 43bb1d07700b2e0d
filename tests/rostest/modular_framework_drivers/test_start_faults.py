# SPDX-License-Identifier: BSD-3-Clause
"""Devices that are at fault when their driver starts: the cause is in `/diagnostics`, and ends the waits for them."""

from __future__ import annotations

import collections
import multiprocessing
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from faulty_grippers import GRIPPER_CASES, emulate_grippers

from modular_framework_testing.emulators.ur_emulator_process import EmulatedArm
from modular_framework_testing.ros_session import until

NODE = """
  <node name="{name}" pkg="modular_framework_control" type="robot_hw" output="screen">
    <rosparam>{{type: modular_framework_drivers/{type}, topic_to_wait_for: {name}_ready, ready_timeout: 20,
                robot_ip_address: {address}, port_name: {port}, baudrate: {baudrate}}}</rosparam>
  </node>"""
SPAWNER = """
  <rosparam>
    robot_hardware: [listed]
    listed: {topic_to_wait_for: listed_ready}
  </rosparam>
  <node name="spawner" pkg="modular_framework_core" type="robot_controllers_spawner" output="screen"
        args="ur5_ezgripper_robot ur5_controller.yaml">
    <param name="timeout" value="5"/>
    <param name="give_up_after" value="25"/>
  </node>"""
CASES: dict[str, tuple[str, dict[str, object], str]] = {
    "nobody_listens": ("cut", {}, "Could not connect to"),
    "nobody_answers": ("freeze", {}, "timed out"),
    "no_power": ("power_off", {}, "has no power; call dashboard/power_on"),
    "protective_stop": ("protective_stop", {}, "protective stop of the arm"),
    "protocol_refused": ("refuse", {"what": "protocol"}, "refuses RTDE protocol 2"),
    "old_software": ("refuse", {"what": "version"}, "has software 3.3.0; at least 3.4 is needed"),
    "slow_link": ("delay", {"seconds": 0.5}, "s late, longer than link_timeout"),
}


class Drivers:
    """The running drivers, as a client of `/diagnostics` sees them.

    Attributes:
        faults: texts of each node so far.
        levels: levels of each node so far.
    """

    def __init__(self, session: Any) -> None:
        self.session = session
        self.faults: dict[str, set[str]] = collections.defaultdict(set)
        self.levels: dict[str, set[int]] = collections.defaultdict(set)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.partition(":")[0]
            self.levels[name].add(ord(status.level) if isinstance(status.level, bytes) else status.level)
            self.faults[name] |= {value.value for value in status.values if value.key == "fault"}


@pytest.fixture(scope="module")
def drivers(
    ros_session: Any, ros_launch: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Drivers]:
    made, arms = Drivers(ros_session), [EmulatedArm() for _ in CASES]
    ports = {name: tmp_path_factory.mktemp(name) / "gripper" for name in GRIPPER_CASES}
    spawn = multiprocessing.get_context("spawn")  # a process of its own, which shares no interpreter with the test
    ours, theirs = spawn.Pipe()
    grippers = spawn.Process(target=emulate_grippers, args=(ports, theirs))
    grippers.start()
    theirs.close()
    assert ours.recv() == "ready"
    nodes = [
        NODE.format(name=name, type="EzGripperRobotHW", address="nowhere", port=ports[name], baudrate=baudrate)
        for name, (_, baudrate, _) in GRIPPER_CASES.items()
    ]
    for (name, (command, arguments, _)), arm in zip(CASES.items(), arms, strict=True):
        arm.command(command, **arguments)
        nodes.append(NODE.format(name=name, type="UrArmRobotHW", address=arm.address, port="none", baudrate=57600))
    ros_launch(f"<launch>{''.join(nodes)}{SPAWNER}</launch>")
    yield made
    ours.close()
    grippers.join(10.0)
    for arm in arms:
        arm.close()


@pytest.mark.parametrize(
    ("name", "text"),
    [(name, case[2]) for name, case in (CASES | GRIPPER_CASES).items()],
)
def test_a_fault_at_the_start_is_in_the_diagnostics_and_ends_the_wait_of_the_node(
    drivers: Drivers, name: str, text: str
) -> None:
    until(lambda: any(text in fault for fault in drivers.faults[name]), f"{text!r} of {name}", timeout_s=60.0)
    assert DiagnosticStatus.ERROR in drivers.levels[name]
    waited = f"waited 20 s in vain for {'the hardware' if name in GRIPPER_CASES else f'True on topic /{name}_ready'}"

    def ended() -> bool:
        lines = [line for line in drivers.session.log().splitlines() if waited in line]
        return any(text in line for line in lines)

    until(ended, f"the end of {name} with its cause", timeout_s=90.0)


def test_the_spawner_of_the_controllers_names_the_causes(drivers: Drivers) -> None:
    waited = "for True on topic /listed_ready of hardware 'listed' in vain; "
    until(lambda: waited in drivers.session.log(), "the end of the spawner", timeout_s=90.0)
    line = next(line for line in drivers.session.log().splitlines() if waited in line)
    assert "Could not connect to" in line and "has no power" in line
