# SPDX-License-Identifier: BSD-3-Clause
"""empty_world.launch takes every argument of Gazebo's, and obeys it or says that it does not."""

from __future__ import annotations

import functools
import time
from typing import Any

import pytest
import roslaunch.arg_dump
import roslaunch.config
import roslaunch.xmlloader
import rospkg
import rospy
import rosservice
from gazebo_msgs.srv import GetPhysicsProperties, GetWorldProperties
from rosgraph_msgs.msg import Clock

from modular_framework_testing.ros_session import until as wait_until

PUBLIC_ARGUMENTS = {
    "paused", "use_sim_time", "extra_gazebo_args", "gui", "recording", "headless", "debug", "physics", "verbose",
    "output", "world_name", "respawn_gazebo", "use_clock_frequency", "pub_clock_frequency", "enable_ros_network",
    "server_required", "gui_required",
}  # fmt: skip
STEPS = """<launch><arg name="time_step"/><arg name="real_time_factor" default="1.0"/>
  <include file="$(find modular_framework_simulation)/launch/simulation.launch" pass_all_args="true"/></launch>"""
LAUNCH = """<launch><include file="$(find gazebo_ros)/launch/empty_world.launch">{}</include></launch>"""

FIXED_ROBOT = """<robot name="stand"><link name="world"/>
  <link name="plate"><collision><geometry><box size="0.4 0.4 0.02"/></geometry></collision></link>
  <joint name="screwed" type="fixed"><parent link="world"/><child link="plate"/></joint></robot>"""

until = functools.partial(wait_until, timeout_s=30.0)


def with_arguments(**arguments: object) -> str:
    return LAUNCH.format("".join(f'<arg name="{name}" value="{value}"/>' for name, value in arguments.items()))


def loaded(text: str) -> Any:
    config = roslaunch.config.ROSLaunchConfig()
    roslaunch.xmlloader.XmlLoader().load_string(text, config)
    return config


def test_it_has_the_arguments_of_gazebo() -> None:
    file = f"{rospkg.RosPack().get_path('gazebo_ros')}/launch/empty_world.launch"
    assert roslaunch.arg_dump.get_args([file]).keys() >= PUBLIC_ARGUMENTS


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({}, (False, False, "screen")),
        ({"server_required": "true"}, (True, False, "screen")),
        ({"respawn_gazebo": "true", "output": "log"}, (False, True, "log")),
    ],
)
def test_the_node_ends_is_started_again_and_prints_as_asked(
    arguments: dict[str, str], expected: tuple[bool, bool, str]
) -> None:
    (node,) = loaded(with_arguments(**arguments)).nodes
    assert (node.required, node.respawn, node.output) == expected


def test_arguments_become_parameters() -> None:
    def parameters(**arguments: object) -> dict[str, Any]:
        return {name: item.value for name, item in loaded(with_arguments(**arguments)).params.items()}

    usual = parameters()
    assert usual["/use_sim_time"] is True
    assert usual["/gazebo/pub_clock_frequency"] == 100
    assert usual["/gazebo/unsupported"] == ""
    other = parameters(use_sim_time="false", use_clock_frequency="true", pub_clock_frequency="40", headless="true")
    assert (other["/use_sim_time"], other["/gazebo/pub_clock_frequency"]) == (False, 40)
    assert parameters(pub_clock_frequency="40")["/gazebo/pub_clock_frequency"] == 100
    assert parameters(extra_gazebo_args="-u")["/gazebo/paused"] is True
    assert parameters(enable_ros_network="false", verbose="true")["/gazebo/enable_ros_network"] is False


def test_the_usual_world_has_a_floor_and_what_has_no_effect_is_named(ros_session: Any) -> None:
    launch = ros_session.launch(
        with_arguments(
            gui="false",
            paused="true",
            physics="ode",
            recording="true",
            debug="true",
            verbose="true",
            extra_gazebo_args="--seed 3",
            use_clock_frequency="true",
            pub_clock_frequency="0",
        )
    )
    for service in ("get_physics_properties", "get_world_properties"):
        ros_session.wait_for_service(f"/gazebo/{service}", 40.0)
    assert rospy.ServiceProxy("/gazebo/get_physics_properties", GetPhysicsProperties)().pause
    assert rospy.ServiceProxy("/gazebo/get_world_properties", GetWorldProperties)().model_names == ["ground_plane"]
    until(lambda: "arguments without effect in this simulation: " in launch.log(), "the warning")
    for each in ("recording:=true", "debug:=true", "physics:=ode", "extra_gazebo_args:=--seed 3"):
        assert each in launch.log()
    launch.stop()


def test_without_its_ros_network_there_is_only_the_clock(ros_session: Any) -> None:
    launch = ros_session.launch(with_arguments(gui="false", enable_ros_network="false"))
    until(lambda: rospy.wait_for_message("/clock", Clock, 40.0).clock.to_sec() > 0, "simulated time")
    until(lambda: "simulation is running" in launch.log(), "the end of the start")
    assert not {"/gazebo/spawn_sdf_model", "/gazebo/set_parameters"} & set(rosservice.get_service_list())
    assert not [name for name, _ in rospy.get_published_topics("/gazebo")]
    launch.stop()


def test_the_time_step_is_chosen_and_a_wrong_one_is_refused(ros_session: Any) -> None:
    launch = ros_session.launch(STEPS, time_step=0.005)
    ros_session.wait_for_service("/gazebo/get_physics_properties", 40.0)
    found = rospy.ServiceProxy("/gazebo/get_physics_properties", GetPhysicsProperties)()
    assert (found.time_step, found.max_update_rate) == pytest.approx((0.005, 200.0))
    launch.stop()
    launch = ros_session.launch(STEPS, time_step=1)
    launch.wait(60.0)
    assert "parameter '/gazebo/time_step' is 1; allowed: a number, at least 0.0001 and at most 0.01" in launch.log()


def test_faster_than_real_time_the_clock_is_published_at_most_250_times_a_second(ros_session: Any) -> None:
    launch = ros_session.launch(STEPS, time_step=0.01, real_time_factor=0)
    until(lambda: rospy.wait_for_message("/clock", Clock, 40.0).clock.to_sec() > 1.0, "simulated time")
    stamps: list[float] = []
    begun_s = time.monotonic()
    subscriber = rospy.Subscriber("/clock", Clock, lambda message: stamps.append(message.clock.to_sec()))
    time.sleep(2.0)
    subscriber.unregister()
    count, passed_s = len(stamps), time.monotonic() - begun_s
    assert stamps == sorted(stamps)
    assert stamps[-1] - stamps[0] > 4.0 * passed_s, "the simulation was not faster than real time"
    assert 10 < count < 250 * passed_s + 20
    launch.stop()


def test_a_required_window_that_cannot_be_is_an_error(ros_session: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ros_session.env, "DISPLAY", "")
    launch = ros_session.launch(with_arguments(gui_required="true", server_required="true"))
    launch.wait(60.0)
    assert "gui_required is true, but no window is available" in launch.log()


def test_a_world_that_is_nowhere_is_named_with_the_places_looked_at(ros_session: Any) -> None:
    launch = ros_session.launch(with_arguments(gui="false", world_name="worlds/moon.world", server_required="true"))
    launch.wait(60.0)
    assert "worlds/moon.world: cannot be read" in launch.log()
    assert "GAZEBO_RESOURCE_PATH" in launch.log()


def test_a_robot_without_movable_joints_is_simulated(ros_session: Any) -> None:
    rospy.set_param("robot_description", FIXED_ROBOT)
    try:
        launch = ros_session.launch(with_arguments(gui="false"))
        until(lambda: rospy.wait_for_message("/clock", Clock, 40.0).clock.to_sec() > 1.0, "simulated time")
        ros_session.wait_for_service("/gazebo/get_world_properties", 40.0)
        names = rospy.ServiceProxy("/gazebo/get_world_properties", GetWorldProperties)().model_names
        assert "stand" in names
        assert launch.alive() and "the simulation loop ended" not in launch.log()
        launch.stop()
    finally:
        rospy.delete_param("robot_description")
