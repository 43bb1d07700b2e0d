# SPDX-License-Identifier: BSD-3-Clause
"""The command `doctor` finds no fault in a running framework, and names each injected fault with a remedy."""

from __future__ import annotations

import os
import signal
from typing import Any
from xmlrpc.client import ServerProxy

import moveit_commander
import pytest
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from moveit_commander import PlanningSceneInterface
from std_srvs.srv import Empty, EmptyRequest

from modular_framework_core.diagnosis.findings import Finding, Level
from modular_framework_core.diagnosis.ros_running_system import running_findings
from modular_framework_ros.calls import request_service
from modular_framework_testing.ros_session import until

CONTROLLERS = "/move_group/controller_list"


def faults() -> list[str]:
    return [finding.text for finding in running_findings() if finding.level is Level.FAULT]


@pytest.fixture(scope="module", autouse=True)
def running_framework(ros_session: Any) -> None:
    for service in ("plan_kinematic_path", "list_grasps", "gazebo/get_world_properties"):
        ros_session.wait_for_service(service, 120.0)
    moveit_commander.roscpp_initialize(["test"])
    until(lambda: faults() == [], "a system without faults", 120.0)


def test_a_running_framework_has_no_fault_and_each_check_says_what_it_saw() -> None:
    findings = list(running_findings())
    assert {finding.level for finding in findings} == {Level.OK}, findings
    texts = " ".join(finding.text for finding in findings)
    for part in (
        "nodes answer",
        "simulated time advances",
        "of all 7 joints",
        "controllers of move_group",
        "touches nothing",
    ):
        assert part in texts


def test_a_frozen_node_is_named_with_its_process() -> None:
    pid = int(ServerProxy(rosgraph.Master("/test").lookupNode("/managers")).getPid("/test")[2])
    os.kill(pid, signal.SIGSTOP)
    try:
        (text,) = faults()
    finally:
        os.kill(pid, signal.SIGCONT)
    assert f"node '/managers' is frozen: its process {pid} was stopped" in text


def test_a_controller_that_no_node_offers_is_named() -> None:
    listed = rospy.get_param(CONTROLLERS)
    other = {
        "name": "/wrist/",
        "action_ns": "follow_joint_trajectory",
        "type": "FollowJointTrajectory",
        "joints": ["a"],
    }
    rospy.set_param(CONTROLLERS, [*listed, other])
    try:
        assert faults() == [
            "move_group sends motions to the action /wrist/follow_joint_trajectory, which no node offers."
        ]
    finally:
        rospy.set_param(CONTROLLERS, listed)


def test_an_object_that_touches_the_robot_is_named() -> None:
    scene = PlanningSceneInterface(synchronous=True)
    pose = PoseStamped()
    pose.header.frame_id, pose.pose.orientation.w = "forearm_link", 1.0
    scene.add_box("wall", pose, (0.3, 0.3, 0.3))
    try:
        (text,) = faults()
    finally:
        scene.remove_world_object("wall")
    assert "Plans cannot start here" in text and "forearm_link and wall" in text


def test_a_simulation_that_is_paused_is_a_note() -> None:
    request_service("gazebo/pause_physics", Empty, EmptyRequest(), 10.0)
    try:
        notes = [finding for finding in running_findings() if "stands still" in finding.text]
    finally:
        request_service("gazebo/unpause_physics", Empty, EmptyRequest(), 10.0)
    assert [finding.level for finding in notes] == [Level.NOTE]


def test_the_fault_of_a_device_is_named() -> None:
    publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=1)
    status = DiagnosticStatus(level=DiagnosticStatus.ERROR, name="arm", message="protective stop")
    timer = rospy.Timer(rospy.Duration(0.2), lambda _: publisher.publish(DiagnosticArray(status=[status])))
    try:
        assert faults() == ["arm: protective stop."]
    finally:
        timer.shutdown()
        publisher.unregister()


def test_every_fault_has_a_remedy() -> None:
    description = rospy.get_param("/robot_description")
    rospy.set_param("/robot_description", "<robot")
    try:
        found: list[Finding] = [item for item in running_findings() if item.level is Level.FAULT]
    finally:
        rospy.set_param("/robot_description", description)
    assert [item.text for item in found] == ["The parameter robot_description has no valid robot description."]
    assert all(item.remedy and item.anchor for item in found)
