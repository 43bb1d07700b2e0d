# SPDX-License-Identifier: BSD-3-Clause
"""The Python modules that graphical tools and user scripts import to find and to switch controllers."""

from __future__ import annotations

from typing import Any

import pytest
import rospy
from controller_manager import controller_manager_interface as interface
from controller_manager_msgs import utils
from controller_manager_msgs.msg import ControllerState, HardwareInterfaceResources
from controller_manager_msgs.srv import ListControllers, LoadController

POSITION = "hardware_interface::PositionJointInterface"


@pytest.fixture(scope="module")
def manager(ros_session: Any) -> str:
    rospy.wait_for_service("/controller_manager/list_controllers", 60.0)
    return "/controller_manager"


def test_the_functions_say_and_return_what_was_done(manager: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert interface.load_controller("arm")
    assert not interface.load_controller("absent")
    assert interface.load_controller("jog")
    assert interface.start_controllers(["arm"])
    assert not interface.start_controller("jog"), "shoulder is claimed by arm"
    assert interface.start_stop_controllers(["jog"], ["arm"])
    assert interface.reload_libraries(force_kill=True, restore=True)
    interface.list_controllers()
    assert not interface.reload_libraries(force_kill=False)
    assert interface.stop_controller("jog")
    assert interface.unload_controller("jog") and interface.unload_controller("arm")
    assert capsys.readouterr().out.splitlines() == [
        "Loaded 'arm'",
        "Error when loading 'absent'",
        "Loaded 'jog'",
        "Started ['arm'] successfully",
        "Error when starting ['jog'] and stopping []",
        "Started ['jog'] successfully",
        "Stopped ['arm'] successfully",
        "Restore: True",
        "Successfully reloaded libraries",
        "Controllers restored to original state",
        f"'arm' - '{POSITION}' ( initialized )",
        f"'jog' - '{POSITION}' ( running )",
        "Restore: False",
        "Failed to reload libraries. Do you still have controllers loaded?",
        "Stopped ['jog'] successfully",
        "Unloaded 'jog' successfully",
        "Unloaded 'arm' successfully",
    ]


def test_managers_and_controllers_are_found(manager: str) -> None:
    assert utils.get_controller_managers() == [manager]
    assert utils.get_controller_managers("/elsewhere") == []
    assert utils.is_controller_manager(manager) and not utils.is_controller_manager("/")
    lister = utils.ControllerManagerLister()
    assert lister() == lister() == [manager]
    assert utils.get_rosparam_controller_names() == ["arm", "jog", "states"]
    assert utils.get_rosparam_controller_names("/deeper") == ["jog"]


def test_an_incomplete_or_wrong_manager_is_none(manager: str) -> None:
    services = [
        rospy.Service("/wrong/list_controllers", ListControllers, lambda request: None),
        rospy.Service("/wrong/unload_controller", LoadController, lambda request: None),
    ]
    assert utils.get_controller_managers() == [manager]
    for service in services:
        service.shutdown()


def test_controllers_are_listed_as_long_as_their_manager_runs(manager: str) -> None:
    lister = utils.ControllerLister(manager)
    assert lister() == []
    assert interface.load_controller("arm")
    [arm] = lister()
    assert (arm.name, arm.state, arm.claimed_resources[0].resources) == ("arm", "initialized", ["wrist", "shoulder"])
    assert utils.ControllerLister("/elsewhere")() == []
    assert interface.unload_controller("arm")
    lister.close()


CONTROLLERS = [
    ControllerState(
        "arm",
        "running",
        "position_controllers/JointTrajectoryController",
        [HardwareInterfaceResources(POSITION, ["a", "b"])],
    ),
    ControllerState(
        "base",
        "stopped",
        "velocity_controllers/JointVelocityController",
        [
            HardwareInterfaceResources("hardware_interface::VelocityJointInterface", ["b", "c"]),
            HardwareInterfaceResources(POSITION, ["d"]),
        ],
    ),
]


@pytest.mark.parametrize(
    ("found", "names"),
    [
        (utils.filter_by_name(CONTROLLERS, "arm"), ["arm"]),
        (utils.filter_by_name(CONTROLLERS, "a"), []),
        (utils.filter_by_name(CONTROLLERS, "a", match_substring=True), ["arm", "base"]),
        (utils.filter_by_state(CONTROLLERS, "running"), ["arm"]),
        (utils.filter_by_type(CONTROLLERS, "Trajectory", match_substring=True), ["arm"]),
        (utils.filter_by_hardware_interface(CONTROLLERS, POSITION), ["arm", "base"]),
        (utils.filter_by_hardware_interface(CONTROLLERS, "Velocity", match_substring=True), ["base"]),
        (utils.filter_by_resources(CONTROLLERS, ["b"]), ["arm", "base"]),
        (utils.filter_by_resources(CONTROLLERS, ["b", "d"]), []),
        (utils.filter_by_resources(CONTROLLERS, ["b", "d"], match_any=True), ["arm", "base"]),
        (utils.filter_by_resources(CONTROLLERS, ["b"], hardware_interface=POSITION), ["arm"]),
        (
            utils.filter_by_resources(CONTROLLERS, ["d", "a"], hardware_interface=POSITION, match_any=True),
            ["arm", "base"],
        ),
    ],
)
def test_controllers_are_filtered(found: list[ControllerState], names: list[str]) -> None:
    assert [controller.name for controller in found] == names
