# SPDX-License-Identifier: BSD-3-Clause
"""Calls every service and topic of gazebo_ros with valid and with invalid input, and checks the effect or the refusal.

The results form the tables in docs/reference/gazebo_interface.md. A test compares the page with the results; with the
environment variable WRITE_GAZEBO_INTERFACE=1, the test writes the page.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import rosgraph
import rospy
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.msg import Config, ConfigDescription, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from gazebo_msgs import msg, srv
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from roscpp.srv import GetLoggers, SetLoggerLevel
from rosgraph_msgs.msg import Clock, Log
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Empty, Trigger

from modular_framework_testing.ros_session import hears, until

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "gazebo_interface.md"
CHANGING = ("spawn_", "set_", "delete_", "apply_", "clear_", "pause_", "unpause_", "reset_")
NAN, UPRIGHT = math.nan, Quaternion(0, 0, 0, 1)
MASS = "<inertial><mass>{}</mass><inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial>"
SHAPE = "<collision name='shape'><geometry><box><size>.1 .1 .1</size></box></geometry></collision>"
CUBE = f"<model name='cube'><pose>0 0 1 0 0 0</pose><link name='link'>{MASS.format(0.2)}{SHAPE}</link></model>"
WORLD = f"""<sdf version='1.6'><world name='w'><gravity>0 0 0</gravity>
  <model name='floor'><static>true</static><link name='link'>{SHAPE}</link></model>
  {CUBE}
  <model name='door'><pose>3 0 1 0 0 0</pose><link name='post'>{MASS.format(5)}{SHAPE}</link>
    <link name='leaf'><pose>0.4 0 0 0 0 0</pose>{MASS.format(0.5)}{SHAPE}</link>
    <joint name='fast' type='fixed'><parent>world</parent><child>post</child></joint>
    <joint name='hinge' type='revolute'><pose>-0.4 0 0 0 0 0</pose><parent>post</parent><child>leaf</child>
      <axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper></limit></axis></joint></model>
</world></sdf>"""
BALL = f"<sdf version='1.6'><model name='ball'><link name='link'>{MASS.format(0.1)}{SHAPE}</link></model></sdf>"
URDF = """<robot name='ball'><link name='body'><inertial><mass value='0.3'/><inertia ixx='0.001' iyy='0.001' izz='0.001'
  ixy='0' ixz='0' iyz='0'/></inertial><collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision></link>
  </robot>"""
HINGE_INERTIA = 0.01 + 0.5 * 0.4**2
LAUNCH = """<launch><include file="$(find modular_framework_simulation)/launch/simulation.launch">
  <arg name="world_file" value="{world}"/></include></launch>"""


@dataclass(frozen=True)
class Case:
    """A service or topic; `good` asserts an effect and names it, `bad` asserts a refusal and quotes it."""

    name: str
    type: str
    good: Callable[[], str]
    bad: Callable[[], str]


SERVICES: dict[str, Case] = {}
TOPICS: dict[str, Case] = {}
SEEN: dict[tuple[str, str, str], str] = {}


def call(name: str, kind: Any, *values: Any, **fields: Any) -> Any:
    rospy.wait_for_service(f"/gazebo/{name}", 20.0)
    return rospy.ServiceProxy(f"/gazebo/{name}", kind)(*values, **fields)


def done(answer: Any) -> Any:
    assert answer.success, answer.status_message
    return answer


def refused(answer: Any) -> str:
    """The reason of a refusal, without the list of what there is."""
    assert not answer.success
    text = str(answer.status_message)
    assert text.startswith("/gazebo/"), "the reason names the service"
    return text.partition(": ")[2].partition("; known")[0]


def failed(name: str, kind: Any, *values: Any) -> str:
    """The reason of a call that fails, for types without a field for that."""
    with pytest.raises(rospy.ServiceException) as error:
        call(name, kind, *values)
    text = str(error.value)
    assert f"/gazebo/{name}: " in text
    return text.partition(f"/gazebo/{name}: ")[2].partition("; known")[0]


def no_input() -> str:
    return "no input"


def at(x: float, y: float, z: float) -> Pose:
    return Pose(Point(x, y, z), UPRIGHT)


def state(model: str, frame: str = "") -> Any:
    return done(call("get_model_state", srv.GetModelState, model, frame))


def hinge() -> Any:
    return done(call("get_joint_properties", srv.GetJointProperties, "door::hinge"))


def models() -> list[str]:
    return list(done(call("get_world_properties", srv.GetWorldProperties)).model_names)


def time_s() -> float:
    return float(done(call("get_world_properties", srv.GetWorldProperties)).sim_time)


def pass_time(duration_s: float) -> None:
    begun_s = time_s()
    until(lambda: time_s() > begun_s + duration_s, f"{duration_s} s of simulated time")


@contextmanager
def spawned(name: str = "ball") -> Iterator[None]:
    done(call("spawn_sdf_model", srv.SpawnModel, name, BALL, "", at(0, 5, 1), ""))
    try:
        yield
    finally:
        call("delete_model", srv.DeleteModel, name)


@pytest.fixture(scope="module")
def simulation(ros_session: Any, tmp_path_factory: pytest.TempPathFactory) -> Any:
    world = tmp_path_factory.mktemp("worlds") / "interface.world"
    world.write_text(WORLD)
    launch = ros_session.launch(LAUNCH.format(world=world))
    ros_session.wait_for_service("/gazebo/get_world_properties", 40.0)
    return launch


@pytest.fixture(autouse=True)
def rest(simulation: Any) -> None:
    """Every case begins with everything in its place, at rest."""
    call("unpause_physics", Empty)
    call("reset_world", Empty)


def service(kind: Any, bad: Callable[[], str]) -> Callable[[Callable[[], str]], None]:
    """Registers a function as the good case of the service of its name."""

    def register(good: Callable[[], str]) -> None:
        SERVICES[good.__name__] = Case(good.__name__, kind._type, good, bad)

    return register


def topic(kind: Any, bad: Callable[[], str]) -> Callable[[Callable[[], str]], None]:
    """Registers a function as the good case of the topic of its name."""

    def register(good: Callable[[], str]) -> None:
        name = good.__name__.removesuffix("_topic")
        TOPICS[name] = Case(name, kind._type, good, bad)

    return register


def heard(name: str, kind: Any) -> Any:
    return rospy.wait_for_message(name if name.startswith("/") else f"/gazebo/{name}", kind, 15.0)


@contextmanager
def reasons_in_log() -> Iterator[list[str]]:
    """Collects what is logged."""
    reasons: list[str] = []
    listener = rospy.Subscriber("/rosout", Log, lambda item: reasons.append(item.msg))
    until(lambda: hears(listener, "/gazebo"), "the connection to the simulation's log")
    try:
        yield reasons
    finally:
        listener.unregister()


# ---- models ----


@service(srv.SpawnModel, lambda: refused(call("spawn_sdf_model", srv.SpawnModel, "x", "rubbish", "", Pose(), "")))
def spawn_sdf_model() -> str:
    raised = BALL.replace("<link ", "<pose>0 0 0.5 0 0 0</pose><link ")
    done(call("spawn_sdf_model", srv.SpawnModel, "ball", raised, "", at(0, 2, 1), "cube"))
    found = state("ball").pose.position
    call("delete_model", srv.DeleteModel, "ball")
    assert (found.x, found.y, found.z) == pytest.approx((0, 2, 2.5))
    return "the model exists; its own pose applies relative to the given pose in the reference frame"


@service(srv.SpawnModel, lambda: refused(call("spawn_urdf_model", srv.SpawnModel, "x", BALL, "", Pose(), "")))
def spawn_urdf_model() -> str:
    done(call("spawn_urdf_model", srv.SpawnModel, "ball", URDF, "", at(0, 2, 1), ""))
    mass = done(call("get_link_properties", srv.GetLinkProperties, "ball::body")).mass
    call("delete_model", srv.DeleteModel, "ball")
    assert mass == pytest.approx(0.3)
    return "the model exists, with its mass"


@service(srv.SpawnModel, lambda: refused(call("spawn_gazebo_model", srv.SpawnModel, "cube", BALL, "", Pose(), "")))
def spawn_gazebo_model() -> str:
    done(call("spawn_gazebo_model", srv.SpawnModel, "ball", BALL, "", at(0, 2, 1), ""))
    assert "ball" in models()
    call("delete_model", srv.DeleteModel, "ball")
    return "the model exists (deprecated name of spawn_sdf_model)"


@service(srv.DeleteModel, lambda: refused(call("delete_model", srv.DeleteModel, "mug")))
def delete_model() -> str:
    with spawned():
        done(call("delete_model", srv.DeleteModel, "ball"))
        assert "ball" not in models()
    return "the model no longer exists"


@service(srv.GetModelState, lambda: refused(call("get_model_state", srv.GetModelState, "cube", "nowhere")))
def get_model_state() -> str:
    found = state("cube", "door::leaf")
    assert found.header.frame_id == "door::leaf"
    assert (found.pose.position.x, found.pose.position.z) == pytest.approx((-3.4, 0.0))
    return "pose and twist relative to a model or link"


@service(
    srv.SetModelState,
    lambda: refused(call("set_model_state", srv.SetModelState, msg.ModelState("cube", at(NAN, 0, 1), Twist(), ""))),
)
def set_model_state() -> str:
    twist = Twist(Vector3(0, 0.5, 0), Vector3())
    done(call("set_model_state", srv.SetModelState, msg.ModelState("cube", at(0, 0, 2), twist, "door::post")))
    found = state("cube")
    assert (found.pose.position.x, found.pose.position.z) == pytest.approx((3, 3))
    assert found.twist.linear.y == pytest.approx(0.5)
    return "the model has the given pose and twist"


@service(srv.GetModelProperties, lambda: refused(call("get_model_properties", srv.GetModelProperties, "")))
def get_model_properties() -> str:
    found = done(call("get_model_properties", srv.GetModelProperties, "door"))
    assert (found.body_names, found.joint_names) == (["post", "leaf"], ["fast", "hinge"])
    assert (found.canonical_body_name, found.is_static) == ("post", False)
    return "links, joints, shapes; whether the model is static"


@service(
    srv.SetModelConfiguration,
    lambda: refused(call("set_model_configuration", srv.SetModelConfiguration, "door", "", ["hinge"], [9.0])),
)
def set_model_configuration() -> str:
    done(call("set_model_configuration", srv.SetModelConfiguration, "door", "", ["hinge"], [0.5]))
    assert hinge().position == pytest.approx((0.5,), abs=1e-6)
    return "the joints have the given positions before the service answers"


# ---- links ----


@service(srv.GetLinkState, lambda: refused(call("get_link_state", srv.GetLinkState, "", "")))
def get_link_state() -> str:
    found = done(call("get_link_state", srv.GetLinkState, "door::leaf", "door::post")).link_state
    assert found.pose.position.x == pytest.approx(0.4)
    assert found.reference_frame == "door::post"
    return "pose and twist relative to a model or link"


@service(
    srv.SetLinkState,
    lambda: refused(call("set_link_state", srv.SetLinkState, msg.LinkState("cube::lid", Pose(), Twist(), ""))),
)
def set_link_state() -> str:
    done(call("set_link_state", srv.SetLinkState, msg.LinkState("cube::link", at(1, 0, 0), Twist(), "cube::link")))
    assert state("cube").pose.position.x == pytest.approx(1)
    return "the link has the given pose; its model moves with the link"


@service(srv.GetLinkProperties, lambda: refused(call("get_link_properties", srv.GetLinkProperties, "link")))
def get_link_properties() -> str:
    found = done(call("get_link_properties", srv.GetLinkProperties, "door::leaf"))
    assert (found.mass, found.ixx, found.gravity_mode) == (pytest.approx(0.5), pytest.approx(0.01), True)
    return "mass, centre of mass, inertia; whether gravity acts"


def set_mass(mass: float, gravity_mode: bool = True) -> Any:
    return call(
        "set_link_properties",
        srv.SetLinkProperties,
        link_name="cube::link",
        mass=mass,
        gravity_mode=gravity_mode,
        ixx=0.01,
        iyy=0.01,
        izz=0.01,
    )


@service(srv.SetLinkProperties, lambda: refused(set_mass(-1.0)))
def set_link_properties() -> str:
    done(set_mass(0.8))
    try:
        push("cube::link", "world", 1.0, 0.1)
        pass_time(0.2)
        assert state("cube").twist.linear.x == pytest.approx(0.125, rel=0.02)
    finally:
        done(set_mass(0.2))
    return "a link with four times the mass has a quarter of the acceleration"


def push(body: str, frame: str, force: float, duration_s: float, torque: float = 0.0) -> Any:
    wrench = Wrench(Vector3(force, 0, 0), Vector3(0, 0, torque))
    duration = rospy.Duration.from_sec(duration_s)
    return call("apply_body_wrench", srv.ApplyBodyWrench, body, frame, Point(), wrench, rospy.Time(), duration)


@service(srv.ApplyBodyWrench, lambda: refused(push("cube::link", "nowhere", 1.0, 1.0)))
def apply_body_wrench() -> str:
    done(push("cube::link", "", 1.0, 0.1, 0.02))
    pass_time(0.3)
    found = state("cube").twist
    assert (found.linear.x, found.angular.z) == pytest.approx((0.5, 0.2), rel=0.02)
    return "linear and angular momentum are wrench x duration; afterwards no wrench acts"


@service(srv.BodyRequest, lambda: failed("clear_body_wrenches", srv.BodyRequest, "mug::link"))
def clear_body_wrenches() -> str:
    done(push("cube::link", "", 0.1, -1.0))
    pass_time(0.1)
    call("clear_body_wrenches", srv.BodyRequest, "cube::link")
    before = state("cube").twist.linear.x
    pass_time(0.1)
    assert state("cube").twist.linear.x == pytest.approx(before, rel=1e-3)
    assert before > 0.01
    return "a wrench without a limited duration has ended"


# ---- joints ----


@service(srv.GetJointProperties, lambda: refused(call("get_joint_properties", srv.GetJointProperties, "knee")))
def get_joint_properties() -> str:
    found = hinge()
    assert (found.type, len(found.position), len(found.rate), found.damping) == (found.REVOLUTE, 1, 1, (0.0,))
    assert done(call("get_joint_properties", srv.GetJointProperties, "fast")).type == found.FIXED
    return "type, position, rate, damping"


def set_joint(**settings: Any) -> Any:
    return call("set_joint_properties", srv.SetJointProperties, "hinge", msg.ODEJointProperties(**settings))


@service(srv.SetJointProperties, lambda: refused(set_joint(erp=[0.2])))
def set_joint_properties() -> str:
    done(set_joint(damping=[0.05], loStop=[-1.0], hiStop=[1.0]))
    assert hinge().damping == (0.05,)
    beyond = call("set_model_configuration", srv.SetModelConfiguration, "door", "", ["hinge"], [1.5])
    assert "allowed: -1 to 1 rad" in beyond.status_message
    done(set_joint(vel=[0.5], fmax=[5.0]))
    until(lambda: abs(hinge().rate[0] - 0.5) < 0.02, "the motor's velocity")
    done(set_joint(damping=[0.0], loStop=[-2.0], hiStop=[2.0], vel=[0.0], fmax=[0.0]))
    return "damping, limits and a motor take effect"


def turn(joint: str, effort: float, duration_s: float) -> Any:
    duration = rospy.Duration.from_sec(duration_s)
    return call("apply_joint_effort", srv.ApplyJointEffort, joint, effort, rospy.Time(), duration)


@service(srv.ApplyJointEffort, lambda: refused(turn("door::fast", 1.0, 1.0)))
def apply_joint_effort() -> str:
    done(turn("door::hinge", 0.1, 0.1))
    pass_time(0.2)
    assert hinge().rate[0] == pytest.approx(0.1 * 0.1 / HINGE_INERTIA, rel=0.03)
    return "the momentum is effort x duration; afterwards no effort acts"


@service(srv.JointRequest, lambda: failed("clear_joint_forces", srv.JointRequest, "knee"))
def clear_joint_forces() -> str:
    done(turn("hinge", 0.02, -1.0))
    pass_time(0.1)
    call("clear_joint_forces", srv.JointRequest, "hinge")
    before = hinge().rate[0]
    pass_time(0.1)
    assert hinge().rate[0] == pytest.approx(before, rel=1e-2)
    assert before > 0.01
    return "an effort without a limited duration has ended"


# ---- lights ----


@service(srv.GetLightProperties, lambda: refused(call("get_light_properties", srv.GetLightProperties, "")))
def get_light_properties() -> str:
    return f"refused: {refused(call('get_light_properties', srv.GetLightProperties, 'sun'))}"


def set_light(name: str) -> Any:
    return call("set_light_properties", srv.SetLightProperties, light_name=name, diffuse=ColorRGBA(1, 1, 1, 1))


@service(srv.SetLightProperties, lambda: refused(set_light("")))
def set_light_properties() -> str:
    return f"refused: {refused(set_light('sun'))}"


@service(srv.DeleteLight, lambda: refused(call("delete_light", srv.DeleteLight, "")))
def delete_light() -> str:
    return f"refused: {refused(call('delete_light', srv.DeleteLight, 'sun'))}"


# ---- the world ----


@service(srv.GetWorldProperties, no_input)
def get_world_properties() -> str:
    assert models() == ["floor", "cube", "door"]
    assert time_s() > 0
    return "time and models"


@service(srv.GetPhysicsProperties, no_input)
def get_physics_properties() -> str:
    found = done(call("get_physics_properties", srv.GetPhysicsProperties))
    assert (found.pause, found.gravity.z) == (False, 0.0)
    assert found.time_step * found.max_update_rate == pytest.approx(1.0), "the real time factor"
    return "time step, rate, gravity, solver"


def set_physics(**changes: Any) -> Any:
    present = done(call("get_physics_properties", srv.GetPhysicsProperties))
    fields = {name: getattr(present, name) for name in srv.SetPhysicsPropertiesRequest.__slots__} | changes
    return call("set_physics_properties", srv.SetPhysicsProperties, **fields)


@service(srv.SetPhysicsProperties, lambda: refused(set_physics(gravity=Vector3(0, 0, NAN))))
def set_physics_properties() -> str:
    gravity = 0.05  # m/s^2: the cube, 1 m above the floor, is still in the air after 5 s
    earliest_s = time_s()
    done(set_physics(time_step=0.004, max_update_rate=500.0, gravity=Vector3(0, 0, -gravity)))
    latest_s, real_s = time_s(), time.monotonic()
    try:
        pass_time(1.0)
        assert (time_s() - latest_s) / (time.monotonic() - real_s) == pytest.approx(2.0, rel=0.3)
        shortest_s = time_s() - latest_s
        speed = -state("cube").twist.linear.z
        assert shortest_s - 0.004 <= speed / gravity <= time_s() - earliest_s + 0.004
        ode = done(call("get_physics_properties", srv.GetPhysicsProperties)).ode_config
        ode.cfm = 0.5
        assert "without effect" in done(set_physics(ode_config=ode)).status_message
    finally:
        done(set_physics(time_step=0.002, max_update_rate=500.0, gravity=Vector3()))
    return "time step, real time factor and gravity take effect; the answer names unsupported ODE settings"


@service(Empty, no_input)
def pause_physics() -> str:
    call("pause_physics", Empty)
    before = time_s()
    time.sleep(0.2)
    assert time_s() == before
    return "time is paused"


@service(Empty, no_input)
def unpause_physics() -> str:
    call("pause_physics", Empty)
    call("unpause_physics", Empty)
    pass_time(0.05)
    return "time continues"


def disturb() -> None:
    done(call("set_model_state", srv.SetModelState, msg.ModelState("cube", at(1, 1, 1), Twist(), "")))
    done(call("set_model_configuration", srv.SetModelConfiguration, "door", "", ["hinge"], [0.5]))
    done(push("cube::link", "", 0.1, -1.0))
    pass_time(0.1)


def is_restored() -> bool:
    found = state("cube")
    place, speed = found.pose.position, found.twist.linear
    return max(abs(x) for x in (place.x, place.y, place.z - 1, speed.x, hinge().position[0])) < 1e-6


@service(Empty, no_input)
def reset_world() -> str:
    disturb()
    before = time_s()
    call("reset_world", Empty)
    assert is_restored()
    assert time_s() >= before
    return "models and joints have their initial positions and no velocity; no force acts; time continues"


@service(Empty, no_input)
def reset_simulation() -> str:
    disturb()
    call("reset_simulation", Empty)
    assert is_restored()
    assert time_s() < 0.5
    return "as reset_world; time restarts at 0"


def set_parameter(name: str, value: float) -> dict[str, float]:
    config = Config(doubles=[DoubleParameter(name, value)])
    answer = call("set_parameters", Reconfigure, config).config
    return {item.name: item.value for item in answer.doubles}


def nan_stays_out() -> str:
    with reasons_in_log() as reasons:
        assert set_parameter("gravity_z", NAN)["gravity_z"] == 0.0
        until(lambda: any("gravity_z: got nan" in item for item in reasons), "the reason in the log")
    return "NaN is not set, and the log has the reason (dynamic_reconfigure clamps values outside the range)"


@service(Reconfigure, nan_stays_out)
def set_parameters() -> str:
    done(set_physics(gravity=Vector3(0, 0, -1)))
    assert set_parameter("gravity_x", 0.5)["gravity_z"] == -1.0, "what the service has set stays"
    try:
        pass_time(0.2)
        assert state("cube").twist.linear.x > 0.05
    finally:
        done(set_physics(gravity=Vector3()))
    return "single settings of set_physics_properties take effect (dynamic_reconfigure)"


@service(GetLoggers, no_input)
def get_loggers() -> str:
    assert "rosout" in {item.name for item in call("get_loggers", GetLoggers).loggers}
    return "loggers of the node"


def logger_level() -> str:
    return str({item.name: item.level for item in call("get_loggers", GetLoggers).loggers}["rosout"]).lower()


def unknown_level() -> str:
    before = logger_level()
    call("set_logger_level", SetLoggerLevel, "rosout", "loudest")
    assert logger_level() == before
    return "the level is not changed (service of rospy, without a reason)"


@service(SetLoggerLevel, unknown_level)
def set_logger_level() -> str:
    call("set_logger_level", SetLoggerLevel, "rosout", "DEBUG")
    found = logger_level()
    call("set_logger_level", SetLoggerLevel, "rosout", "INFO")
    assert found == "debug"
    return "the level takes effect"


# ---- topics ----


@topic(Clock, no_input)
def clock_topic() -> str:
    assert heard("/clock", Clock).clock.to_sec() < heard("/clock", Clock).clock.to_sec()
    return "100 Hz of simulated time"


@topic(msg.ModelStates, no_input)
def model_states_topic() -> str:
    found = heard("model_states", msg.ModelStates)
    assert found.name == ["floor", "cube", "door"]
    assert found.pose[1].position.z == pytest.approx(1.0)
    return "all models, at 50 Hz of simulated time"


@topic(msg.LinkStates, no_input)
def link_states_topic() -> str:
    found = heard("link_states", msg.LinkStates)
    assert found.name == ["floor::link", "cube::link", "door::post", "door::leaf"]
    assert found.pose[3].position.x == pytest.approx(3.4)
    return "all links, at 50 Hz of simulated time"


@topic(msg.PerformanceMetrics, no_input)
def performance_metrics_topic() -> str:
    heard("performance_metrics", msg.PerformanceMetrics)
    assert heard("performance_metrics", msg.PerformanceMetrics).real_time_factor == pytest.approx(1.0, abs=0.5)
    return "real time factor, at 5 Hz of simulated time; no sensors"


@topic(ConfigDescription, no_input)
def parameter_descriptions_topic() -> str:
    found = heard("parameter_descriptions", ConfigDescription)
    names = [item.name for group in found.groups for item in group.parameters]
    assert len(names) == 15
    assert {"time_step", "max_update_rate", "gravity_z", "sor_pgs_iters", "erp"} <= set(names)
    return "the 15 physics parameters of Gazebo, latched"


@topic(Config, no_input)
def parameter_updates_topic() -> str:
    heard_values: list[dict[str, Any]] = []
    client = Client("/gazebo", timeout=15.0, config_callback=lambda config: heard_values.append(dict(config)))
    done(set_physics(gravity=Vector3(0, 0, -2)))
    try:
        until(lambda: heard_values and heard_values[-1]["gravity_z"] == -2.0, "an update after set_physics_properties")
    finally:
        done(set_physics(gravity=Vector3()))
        client.close()
    return "every change, latched"


def logged(name: str, kind: Any, message: Any) -> str:
    """Publishes a message that is refused; returns the reason in the log."""
    mark = f"/gazebo/{name} (topic): "
    publisher = rospy.Publisher(f"/gazebo/{name}", kind, queue_size=1)
    until(lambda: publisher.get_num_connections() > 0, "a subscriber")
    with reasons_in_log() as reasons:
        publisher.publish(message)
        until(lambda: any(mark in item for item in reasons), "the reason in the log")
    return next(item for item in reasons if mark in item).partition(mark)[2].partition("; known")[0]


def publish_until(name: str, kind: Any, message: Any, seen: Callable[[], bool]) -> None:
    publisher = rospy.Publisher(f"/gazebo/{name}", kind, queue_size=1)
    until(lambda: publisher.get_num_connections() > 0, "a subscriber")
    publisher.publish(message)
    until(seen, f"the effect of {name}")


@topic(msg.ModelState, lambda: logged("set_model_state", msg.ModelState, msg.ModelState("mug", Pose(), Twist(), "")))
def set_model_state_topic() -> str:
    wanted = msg.ModelState("cube", at(2, 0, 1), Twist(), "")
    publish_until("set_model_state", msg.ModelState, wanted, lambda: abs(state("cube").pose.position.x - 2) < 1e-6)
    return "as the service of the same name"


@topic(msg.LinkState, lambda: logged("set_link_state", msg.LinkState, msg.LinkState("", Pose(), Twist(), "")))
def set_link_state_topic() -> str:
    wanted = msg.LinkState("cube::link", at(2, 0, 1), Twist(), "")
    publish_until("set_link_state", msg.LinkState, wanted, lambda: abs(state("cube").pose.position.x - 2) < 1e-6)
    return "as the service of the same name"


# ---- the tests ----


def interventions() -> list[dict[str, Any]]:
    """Returns what the referee noted: who changed the world by what."""
    return list(json.loads(call("referee", Trigger).message)["interventions"])


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_does_what_it_is_for_and_the_referee_names_who_changed_the_world(name: str) -> None:
    before = interventions()[-1]["number"]
    SEEN["service", name, "good"] = SERVICES[name].good()
    callers = [
        item["caller"] for item in interventions() if item["number"] > before and item["what"] == f"/gazebo/{name}"
    ]
    changes = name.startswith(CHANGING) and not name.endswith(("logger_level", "light_properties", "light"))
    assert set(callers) == ({rospy.get_name()} if changes else set())


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_names_what_is_wrong_with_a_request(name: str) -> None:
    reason = SERVICES[name].bad()
    assert reason and "unexpected" not in reason
    SEEN["service", name, "bad"] = reason


@pytest.mark.parametrize("name", TOPICS)
def test_a_topic_carries_what_it_is_for(name: str) -> None:
    SEEN["topic", name, "good"] = TOPICS[name].good()


@pytest.mark.parametrize("name", TOPICS)
def test_a_topic_names_what_is_wrong_with_a_message(name: str) -> None:
    SEEN["topic", name, "bad"] = TOPICS[name].bad()


def filled(message: Any, number: float, text: str) -> Any:
    """Fills all numbers with one, and all names with a text."""
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        value = getattr(message, name)
        if kind == "float64":
            setattr(message, name, number)
        elif kind == "float64[]":
            setattr(message, name, [number])
        elif kind == "string":
            setattr(message, name, text)
        elif kind == "string[]":
            setattr(message, name, [text])
        elif hasattr(value, "_slot_types"):
            filled(value, number, text)
    return message


@pytest.mark.parametrize("text", ["", "cube", "cube::link", "hinge", "::", "world", "\u00e4\n" * 3000])
@pytest.mark.parametrize("number", [NAN, math.inf, -math.inf, 1e300])
def test_no_number_and_no_name_does_harm(simulation: Any, number: float, text: str) -> None:
    for name in SERVICES:
        kind = getattr(srv, SERVICES[name].type.partition("/")[2], None)
        if SERVICES[name].type.startswith("gazebo_msgs") and name not in ("delete_model", "get_world_properties"):
            try:
                answer = call(name, kind, filled(kind._request_class(), number, text))
            except rospy.ServiceException as error:
                assert "unexpected" not in str(error)
                continue
            assert "unexpected" not in getattr(answer, "status_message", "")
            if name.startswith(("set_", "apply_", "spawn_")):
                assert not answer.success, (name, answer.status_message)
    found = state("cube")
    assert is_restored() and found.pose.orientation.w == pytest.approx(1.0)
    assert models() == ["floor", "cube", "door"]


def test_the_node_has_everything_of_gazebo_ros_and_the_table_leaves_nothing_out(simulation: Any) -> None:
    published, subscribed, services = rosgraph.Master("/test").getSystemState()
    own = {name for name, nodes in services if "/gazebo" in nodes}
    additions = {"hold_time", "advance_time", "step_time", "restart", "referee", "record_world"}
    additions |= {"set_perceived_pose_error"}
    assert own == {f"/gazebo/{name}" for name in (*SERVICES, *additions)}
    topics = {name for name, nodes in (*published, *subscribed) if "/gazebo" in nodes and name.startswith("/gazebo/")}
    own_topics = ("grasped_object", "visible_models", "visible_poses")
    assert topics == {f"/gazebo/{name}" for name in (*TOPICS, *own_topics) if name != "clock"}


def table(kind: str, cases: dict[str, Case]) -> list[str]:
    lines = [f"| {kind} | type | with valid input | with invalid input |", "|---|---|---|---|"]
    for name, case in cases.items():
        shown = "/clock" if name == "clock" else f"/gazebo/{name}"
        good, bad = (SEEN[kind, name, which].replace("|", "/").replace("\n", " ") for which in ("good", "bad"))
        lines.append(f"| `{shown}` | {case.type} | {good} | {bad} |")
    return lines


def test_the_page_says_what_was_seen(simulation: Any) -> None:
    head, _, _ = PAGE.read_text().partition("\n## ") if PAGE.is_file() else ("", "", "")
    sections = ["## Services", "", *table("service", SERVICES), "", "## Topics", "", *table("topic", TOPICS), ""]
    text = head.rstrip("\n") + "\n\n" + "\n".join(sections)
    if os.environ.get("WRITE_GAZEBO_INTERFACE"):
        PAGE.write_text(text)
    assert PAGE.read_text() == text, "run the suite with WRITE_GAZEBO_INTERFACE=1, and look at the difference"


def test_the_node_survived_all_this(simulation: Any) -> None:
    assert simulation.alive(), simulation.log()
    assert "Traceback" not in simulation.log()
    assert "unexpected" not in simulation.log()
