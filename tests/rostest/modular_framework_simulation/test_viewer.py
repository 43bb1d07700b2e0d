# SPDX-License-Identifier: BSD-3-Clause
"""The page of the viewer, as a browser gets it: its address, the scene it is sent, its buttons, and bad messages."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
import signal
import socket
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import msgspec
import numpy as np
import psutil
import pytest
import rosgraph
import rospy
import viser
import zstandard
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import DeleteModel, GetPhysicsProperties, GetWorldProperties, SetModelState, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import CollisionObject, DisplayTrajectory, PlanningScene, RobotTrajectory
from sensor_msgs.msg import Image, JointState
from shape_msgs.msg import SolidPrimitive
from simulation_time_msgs.srv import AdvanceTime
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectoryPoint
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from modular_framework_simulation.models.poses import Pose as SdfPose
from modular_framework_simulation.models.sdf_specs import Box, Visual
from modular_framework_simulation.sensors import scene_text
from modular_framework_testing.chromium import Chromium
from modular_framework_testing.ros_session import free_port, until

URDF = """<robot name="arm"><link name="world"/>
  <link name="upper"><visual><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.1 1"/></geometry></visual>
    <inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="world"/><child link="upper"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="9"/></joint>
</robot>"""
LAUNCH = """<launch>
  <param name="robot_description" value="{urdf}"/>
  <include file="$(find gazebo_ros)/launch/empty_world.launch">
    <arg name="gui" value="false"/>
    <arg name="viewer" value="true"/>
    <arg name="viewer_port" value="{port}"/>
  </include>
</launch>"""
WORLD = """<launch><include file="$(find gazebo_ros)/launch/empty_world.launch">
  <arg name="gui" value="false"/></include></launch>"""
READ_ONLY = """<launch><group ns="watching"><include file="$(find modular_framework_simulation)/launch/viewer.launch">
  <arg name="port" value="{port}"/><arg name="read_only" value="true"/></include></group></launch>"""
BOX = """<sdf version="1.6"><model name="box"><static>true</static><link name="link"><visual name="v"><geometry><box>
  <size>0.1 0.2 0.3</size></box></geometry></visual></link></model></sdf>"""
BALL = """<sdf version="1.6"><model name="ball"><link name="link"><visual name="v"><geometry><sphere>
  <radius>0.1</radius></sphere></geometry></visual></link></model></sdf>"""


PROTOCOL: Any = f"viser-v{viser.__version__}"


def websocket(address: str) -> str:
    """The WebSocket that the page of viser opens."""
    return address.replace("http:", "ws:").rstrip("/")


def address_in(log: str) -> str:
    """The address that the log tells the user to open."""
    found = re.search(r"viewer: open (http://\S+/) in a browser", log)
    assert found, log
    return found[1]


class Browser:
    """What a browser knows of the page: the nodes of its scene with their poses, and the controls of its panel."""

    def __init__(self, address: str, renders: bool = True) -> None:
        """Opens the page; with `renders=False` as a browser whose graphics have not drawn their first frame."""
        self._socket = connect(websocket(address), subprotocols=[PROTOCOL], max_size=None, compression=None)
        self.nodes: dict[str, dict[str, Any]] = {}
        self.controls: dict[str, dict[str, Any]] = {}
        threading.Thread(target=self._read, daemon=True).start()
        if not renders:
            return
        camera = {"wxyz": (1.0, 0, 0, 0), "position": (1.0, 1, 1), "look_at": (0.0, 0, 0), "up_direction": (0.0, 0, 1)}
        self._send("ViewerCameraMessage", **camera, fov=1.0, near=0.01, far=99.0, image_height=600, image_width=800)

    def _send(self, kind: str, **values: Any) -> None:
        self._socket.send(msgspec.msgpack.encode({"type": kind, **values}))

    def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):  # the viewer ends without waiting for browsers
            for data in self._socket:
                assert isinstance(data, bytes)
                packed = data[16 : 16 + int.from_bytes(data[8:16], "little")]
                for message in msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(packed))["messages"]:
                    self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        name, uuid = message.get("name"), message.get("uuid")
        match message["type"]:
            case "RemoveSceneNodeMessage":
                for path in [path for path in self.nodes if path == name or path.startswith(f"{name}/")]:
                    del self.nodes[path]
            case "SetPositionMessage" | "SetOrientationMessage" | "SetSceneNodeVisibilityMessage":
                self.nodes.setdefault(str(name), {}).update(message)
            case "GuiUpdateMessage":
                self.controls.setdefault(str(uuid), {}).update(message["updates"])
            case kind if kind.startswith("Gui") and uuid is not None and "props" in message:
                control = self.controls.setdefault(str(uuid), {})
                control.update(message["props"])
                if "value" in message:
                    control["value"] = message["value"]
            case _ if name is not None:
                self.nodes.setdefault(str(name), {})

    def position(self, node: str) -> np.ndarray:
        return np.array(self.nodes.get(node, {}).get("position", (math.nan,) * 3))

    def follows(self, node: str, position: tuple[float, float, float], tolerance_m: float = 1e-3) -> None:
        until(lambda: np.allclose(self.position(node), position, atol=tolerance_m), f"{node} is at {position}")

    def uuid(self, label: str) -> str:
        return next(uuid for uuid, control in self.controls.items() if control.get("label") == label)

    def set(self, label: str, value: Any) -> None:
        self._send("GuiUpdateMessage", uuid=self.uuid(label), updates={"value": value})

    def value(self, label: str) -> Any:
        return self.controls[self.uuid(label)].get("value")

    def text(self) -> str:
        return " ".join(str(control.get("_markdown", "")) for control in self.controls.values())

    def close(self) -> None:
        self._socket.close()


@pytest.fixture(scope="module")
def port() -> int:
    return free_port()


@pytest.fixture(scope="module")
def launch(ros_session: Any, port: int) -> Iterator[Any]:
    urdf = URDF.replace("<", "&lt;").replace('"', "&quot;")
    launch = ros_session.launch(LAUNCH.format(urdf=urdf, port=port))
    rospy.wait_for_service("/gazebo/spawn_sdf_model", 60.0)
    until(lambda: "/ in a browser" in launch.log(), "the address in the log")
    yield launch
    launch.stop()


@pytest.fixture(scope="module")
def page(launch: Any) -> Iterator[Browser]:
    browser = Browser(address_in(launch.log()))
    until(lambda: "/robot/upper" in browser.nodes, "the robot is drawn")
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def box(page: Browser) -> Browser:
    spawn("box", BOX, (1.0, 0.0, 0.5))
    page.follows("/world/box/link", (1.0, 0.0, 0.5))
    return page


def call(name: str, kind: Any, *values: Any) -> Any:
    rospy.wait_for_service(name, 20.0)
    return rospy.ServiceProxy(name, kind)(*values)


def spawn(name: str, text: str, position: tuple[float, float, float]) -> None:
    pose = Pose(Point(*position), Quaternion(0, 0, 0, 1))
    answer = call("/gazebo/spawn_sdf_model", SpawnModel, name, text, "", pose, "world")
    assert answer.success, answer.status_message


def move(name: str, position: tuple[float, float, float]) -> None:
    state = ModelState(model_name=name, pose=Pose(Point(*position), Quaternion(0, 0, 0, 1)))
    assert call("/gazebo/set_model_state", SetModelState, state).success


def now_s() -> float:
    return float(call("/gazebo/get_world_properties", GetWorldProperties).sim_time)


def is_paused() -> bool:
    return bool(call("/gazebo/get_physics_properties", GetPhysicsProperties).pause)


def subscribed_topics() -> set[str]:
    _, subscribed, _ = rosgraph.Master("/test").getSystemState()
    return {topic for topic, nodes in subscribed if "/viewer" in nodes}


def published(topic: str, kind: Any) -> Any:
    publisher = rospy.Publisher(topic, kind, queue_size=10, latch=True)
    until(lambda: publisher.get_num_connections() > 0, f"the viewer subscribes to {topic}")
    return publisher


def test_the_page_is_served_on_the_loopback_address_only_and_nothing_is_done_before_it_is_opened(
    launch: Any, port: int
) -> None:
    address = address_in(launch.log())
    assert address.startswith(f"http://127.0.0.1:{port}/")
    with urllib.request.urlopen(address, timeout=5.0) as answer:
        assert answer.status == 200 and b"<html" in answer.read().lower()
    addresses = [
        each.address for each in itertools.chain(*psutil.net_if_addrs().values()) if each.family == socket.AF_INET
    ]
    for address in {*addresses, "127.0.0.2"} - {"127.0.0.1"}:
        with pytest.raises(ConnectionRefusedError), socket.create_connection((address, port), 2.0):
            pass
    assert not {name for name in subscribed_topics() if "gazebo" in name or "joint" in name}


@pytest.mark.parametrize(
    ("path", "headers", "reason"),
    [
        ("/", {}, "token is missing or wrong"),
        ("/{token}x", {}, "token is missing or wrong"),
        ("/x/{token}", {}, "token is missing or wrong"),
        ("/?{token}", {}, "token is missing or wrong"),
        ("/{token}", {"Origin": "http://evil.example"}, "Origin 'http://evil.example' is another page"),
        ("/{token}", {"Origin": "http://127.0.0.1:1"}, "Origin 'http://127.0.0.1:1' is another page"),
        ("/{token}", {"Origin": "null"}, "Origin 'null' is another page"),
        ("/{token}", {"Host": "evil.example:{port}"}, "Host 'evil.example:{port}' is not this server"),
        ("/{token}", {"Host": "127.0.0.1:1"}, "Host '127.0.0.1:1' is not this server"),
        ("/{token}", {"Host": "evil.example:{port}", "Origin": "http://evil.example:{port}"}, "Host 'evil.example"),
    ],
)
def test_another_page_and_a_wrong_token_get_nothing(
    launch: Any, port: int, path: str, headers: dict[str, str], reason: str
) -> None:
    own = websocket(address_in(launch.log()))
    token = own.rpartition("/")[2]
    values = {"token": token, "port": port}
    sent = {"Host": f"127.0.0.1:{port}", **{name: value.format(**values) for name, value in headers.items()}}
    lines = [f"{name}: {value}\r\n" for name, value in sent.items()]
    upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    key = f"Sec-WebSocket-Key: {'a' * 22}==\r\nSec-WebSocket-Protocol: {PROTOCOL}\r\n"
    for handshake in ("", upgrade + key):
        with socket.create_connection(("127.0.0.1", port), 10.0) as stream:
            text = f"GET {path.format(**values)} HTTP/1.1\r\n{''.join(lines)}{handshake}\r\n"
            stream.sendall(text.encode())
            answer = b"".join(iter(lambda: stream.recv(65536), b"")).decode()
        assert answer.startswith("HTTP/1.1 403"), answer
        assert reason.format(**values) in answer


def test_a_browser_on_the_own_page_is_admitted(launch: Any, port: int) -> None:
    own = websocket(address_in(launch.log()))
    for host in (f"http://127.0.0.1:{port}", f"http://localhost:{port}"):
        address = own.replace(f"ws://127.0.0.1:{port}", host.replace("http", "ws"))
        with connect(address, origin=host, subprotocols=[PROTOCOL], max_size=None, compression=None) as admitted:
            assert admitted.recv(timeout=20.0)
    with pytest.raises(InvalidStatus):
        connect(own, origin="http://localhost", subprotocols=[PROTOCOL])


def test_the_address_is_published_for_a_page_that_embeds_the_viewer(launch: Any) -> None:
    assert rospy.wait_for_message("/viewer/page_address", String, 20.0).data == address_in(launch.log())


def test_a_read_only_page_shows_the_world_and_refuses_to_act_on_it(launch: Any, ros_session: Any) -> None:
    watching = ros_session.launch(READ_ONLY.format(port=free_port()))
    until(lambda: "/ in a browser" in watching.log(), "the address in the log")
    browser = Browser(address_in(watching.log()))
    until(lambda: "/robot/upper" in browser.nodes, "the robot is drawn")
    until(lambda: "Time" in browser.text(), "the time is shown")
    browser.set("Pause", True)
    browser.set("Reset poses and time", True)
    until(lambda: watching.log().count("the viewer is read-only") >= 2, "both are refused")
    assert not is_paused()
    browser.close()
    watching.stop()


def test_the_scene_follows_models_that_come_move_and_go(box: Browser) -> None:
    move("box", (0.5, -1.0, 2.0))
    box.follows("/world/box/link", (0.5, -1.0, 2.0))
    spawn("second", BOX, (3.0, 0.0, 0.0))
    box.follows("/world/second/link", (3.0, 0.0, 0.0))
    assert call("/gazebo/delete_model", DeleteModel, "second").success
    until(lambda: "/world/second/link" not in box.nodes and "/world/box/link" in box.nodes, "it is gone")


def test_the_robot_follows_joint_states(page: Browser) -> None:
    publisher = published("joint_states", JointState)
    publisher.publish(JointState(name=["shoulder"], position=[math.pi / 2]))

    def turned() -> bool:
        return np.allclose(np.abs(page.nodes["/robot/upper"].get("wxyz", 0)), (0.5**0.5, 0, 0.5**0.5, 0), atol=1e-3)

    until(turned, "the arm has turned by 90 degrees about y")
    assert page.position("/robot/upper") == pytest.approx((0, 0, 0.2))


def test_buttons_pause_step_resume_and_reset(box: Browser) -> None:
    box.set("Pause", True)
    until(is_paused, "time is paused")
    until(lambda: "paused" in box.text(), "the panel says so")
    before_s = now_s()
    move("box", (0.0, 0.0, 4.0))  # is seen also while time stands still
    box.follows("/world/box/link", (0.0, 0.0, 4.0))
    step_s = call("/gazebo/get_physics_properties", GetPhysicsProperties).time_step
    box.set("Step", "1 step")
    until(lambda: now_s() > before_s, "a step")
    assert now_s() == pytest.approx(before_s + step_s, abs=1e-9)
    box.set("Step", "0.1 s")
    until(lambda: now_s() > before_s + 0.1, "a tenth of a second")
    assert now_s() == pytest.approx(before_s + step_s + 0.1, abs=1e-9) and is_paused()
    box.set("Reset poses", True)
    box.follows("/world/box/link", (1.0, 0.0, 0.5))
    assert now_s() > 0.1
    box.set("Reset poses and time", True)
    until(lambda: now_s() == 0.0, "time is 0")
    box.set("Resume", True)
    until(lambda: now_s() > 0.2, "time passes again")


def test_a_step_needs_a_pause_and_has_bounds(launch: Any) -> None:
    for duration_s, reason in ((0.1, "not paused"), (1.5, "allowed: 0"), (-1.0, "allowed: 0")):
        answer = call("/gazebo/step_time", AdvanceTime, rospy.Duration.from_sec(duration_s))
        assert not answer.success and reason in answer.message


def test_the_speed_is_that_of_the_choice_and_is_shown(box: Browser) -> None:
    def factor() -> float:
        present = call("/gazebo/get_physics_properties", GetPhysicsProperties)
        return float(present.max_update_rate * present.time_step)

    for choice, expected in (("0.5", 0.5), ("as fast as possible", 0.0), ("1", 1.0)):
        box.set("Speed", choice)
        until(lambda expected=expected: abs(factor() - expected) < 1e-9, f"speed {choice}")  # type: ignore[misc]
    until(lambda: "real time factor" in box.text(), "the factor beside the time, once it runs again")


def test_the_planning_scene_is_subscribed_to_and_drawn_only_while_it_is_shown(box: Browser) -> None:
    topic = "/move_group/monitored_planning_scene"
    assert topic not in subscribed_topics()
    box.set("Planning scene", True)
    publisher = published(topic, PlanningScene)
    scene = PlanningScene()
    item = CollisionObject(id="wall", operation=CollisionObject.ADD)
    item.header.frame_id = "world"
    item.pose = Pose(Point(0, 2, 0), Quaternion(0, 0, 0, 1))
    item.primitives = [SolidPrimitive(SolidPrimitive.BOX, [1, 0.1, 1])]
    scene.world.collision_objects = [item]
    publisher.publish(scene)
    box.follows("/planning scene/wall", (0.0, 2.0, 0.0))
    box.set("Planning scene", False)
    until(lambda: "/planning scene/wall" not in box.nodes and topic not in subscribed_topics(), "it is hidden")


def test_a_plan_is_drawn_and_replayed_by_a_ghost(box: Browser) -> None:
    part = RobotTrajectory()
    part.joint_trajectory.joint_names = ["shoulder"]
    part.joint_trajectory.points = [
        JointTrajectoryPoint(positions=[0.0]),
        JointTrajectoryPoint(positions=[1.0], time_from_start=rospy.Duration(1)),
    ]
    published("/move_group/display_planned_path", DisplayTrajectory).publish(DisplayTrajectory(trajectory=[part]))
    until(lambda: "/plan/path" in box.nodes and "/plan/ghost/upper" in box.nodes, "line and ghost")
    until(lambda: "/plan/ghost/upper" not in box.nodes, "the end of the replay")
    box.set("Position", 1.0)
    expected = (math.cos(0.5), 0, math.sin(0.5), 0)
    until(lambda: np.allclose(box.nodes.get("/plan/ghost/upper", {}).get("wxyz", 0), expected, atol=1e-3), "its end")


def test_an_image_is_subscribed_to_while_it_is_chosen(box: Browser) -> None:
    publisher = rospy.Publisher("/lab/image", Image, queue_size=1)
    uuid = box.uuid("Image")
    until(lambda: "/lab/image" in box.controls[uuid]["options"], "the topic is offered")
    assert publisher.get_num_connections() == 0
    box.set("Image", "/lab/image")
    until(lambda: publisher.get_num_connections() > 0, "it is subscribed to")
    publisher.publish(Image(encoding="nonsense", height=1, width=1, step=1, data=b"1"))
    image = Image(encoding="rgb8", height=2, width=2, step=6, data=bytes(12))

    def is_shown() -> bool:
        publisher.publish(image)
        return any(control.get("visible") and control.get("_format") == "jpeg" for control in box.controls.values())

    until(is_shown, "the image")
    box.set("Image", "none")
    until(lambda: publisher.get_num_connections() == 0, "the subscription has ended")


def test_bad_messages_are_named_and_change_nothing(launch: Any, box: Browser) -> None:
    for topic, fault in (
        ("visible_models", "not a list of visible models"),
        ("visible_poses", "not the poses of visible models"),
    ):
        publisher = published(f"/gazebo/{topic}", String)
        texts = itertools.cycle(("", "\x00", "[1]", '{"poses": {"x": 3}}', "[" * 5000))

        def is_named(publisher: Any = publisher, texts: Iterator[str] = texts, fault: str = fault) -> bool:
            publisher.publish(String(next(texts)))  # the simulation publishes too, and the newest message counts
            return fault in launch.log()

        until(is_named, fault)
        publisher.unregister()
    joints = published("joint_states", JointState)
    joints.publish(JointState(name=["shoulder", "x"], position=[1.0]))
    joints.publish(JointState(name=["shoulder"], position=[math.nan]))
    published("/move_group/display_planned_path", DisplayTrajectory).publish(
        DisplayTrajectory(trajectory=[trajectory_without_numbers()])
    )
    until(lambda: "2 joints have 1 positions" in launch.log(), "the joint state is named")
    until(lambda: "1 joints have 0 positions" in launch.log(), "the plan is named")
    spawn("after", BALL, (0.0, 0.0, 0.5))
    until(lambda: "/world/after/link" in box.nodes, "new models are drawn")
    assert not re.search(r": unexpected \w+: ", launch.log())


def trajectory_without_numbers() -> RobotTrajectory:
    part = RobotTrajectory()
    part.joint_trajectory.joint_names = ["shoulder"]
    part.joint_trajectory.points = [JointTrajectoryPoint()]
    return part


def test_a_browser_that_has_not_drawn_a_frame_gets_panel_and_scene(box: Browser, launch: Any) -> None:
    box.close()  # the only other browser
    until(lambda: "/gazebo/visible_poses" not in subscribed_topics(), "no browser")
    browser = Browser(address_in(launch.log()), renders=False)
    until(lambda: "real time factor" in browser.text(), "the time is shown")
    move("box", (0.2, 0.3, 0.4))
    browser.follows("/world/box/link", (0.2, 0.3, 0.4))
    browser.close()


def test_the_panel_stands_beside_the_scene_and_hides_nothing_of_it(launch: Any) -> None:
    with Chromium(address_in(launch.log())) as browser:
        ends = """(() => { const elements = [...document.querySelectorAll("*")];
            const text = elements.findLast((element) => element.textContent.includes("real time factor"));
            const scene = document.querySelector("canvas");
            return [scene?.getBoundingClientRect().right, text?.getBoundingClientRect().left]; })()"""
        until(lambda: all(browser.evaluate(ends)), "scene and panel", 60.0)
        right_of_scene, left_of_text = browser.evaluate(ends)
        assert 0.0 < right_of_scene <= left_of_text


def test_a_reloaded_page_and_a_second_browser_show_the_present(launch: Any) -> None:
    spawn("seen", BOX, (1.0, 1.0, 1.0))
    first, second = Browser(address_in(launch.log())), Browser(address_in(launch.log()))
    for browser in (first, second):
        browser.follows("/world/seen/link", (1.0, 1.0, 1.0))
    first.close()
    move("seen", (2.0, 2.0, 2.0))
    second.follows("/world/seen/link", (2.0, 2.0, 2.0))
    reloaded = Browser(address_in(launch.log()))
    reloaded.follows("/world/seen/link", (2.0, 2.0, 2.0))
    assert call("/gazebo/delete_model", DeleteModel, "seen").success
    for browser in (second, reloaded):
        until(lambda browser=browser: "/world/seen/link" not in browser.nodes, "it is gone")  # type: ignore[misc]
        browser.close()


def test_without_a_page_nothing_is_subscribed_to(page: Browser) -> None:
    page.close()
    until(lambda: not {name for name in subscribed_topics() if "gazebo" in name or "joint" in name}, "it rests")


def pid_of(node: str) -> int:
    return int(ServerProxy(rosgraph.Master("/test").lookupNode(node)).getPid("/test")[2])


@pytest.fixture
def viewer(ros_session: Any) -> Iterator[tuple[str, psutil.Process]]:
    """Starts one more viewer; yields its address and process."""
    launch = ros_session.launch(READ_ONLY.format(port=free_port()))
    until(lambda: "/ in a browser" in launch.log(), "the address in the log")
    yield address_in(launch.log()), psutil.Process(pid_of("/watching/viewer"))
    launch.stop()


def test_a_slow_file_neither_freezes_the_status_nor_keeps_the_viewer_alive(
    viewer: tuple[str, psutil.Process], tmp_path: Path
) -> None:
    texture = tmp_path / "slow.png"
    os.mkfifo(texture)  # stands for a slow disk: whoever reads it waits
    seen = Visual("v", SdfPose(), Box((1.0, 1.0, 1.0)), (1.0, 1.0, 1.0, 1.0), texture)
    model = scene_text.VisibleModel(999, "slow", (scene_text.VisibleLink("link", (seen,)),))
    address, process = viewer
    browser = Browser(address)
    until(lambda: "real time factor" in browser.text(), "the time is shown")
    publisher = published("/gazebo/visible_models", String)

    def is_loading() -> bool:
        publisher.publish(String(scene_text.models_to_text([model])))  # the newest message counts
        return "Loading the world." in browser.text()

    until(is_loading, "the activity is named")
    before = browser.text()
    until(lambda: "Loading the world." in browser.text() != before, "time goes on")
    publisher.unregister()
    process.send_signal(signal.SIGINT)
    process.wait(30.0)


def test_a_killed_simulation_is_named_and_its_successor_is_shown(
    launch: Any, ros_session: Any, viewer: tuple[str, psutil.Process]
) -> None:
    browser = Browser(viewer[0])
    until(lambda: "real time factor" in browser.text(), "the time is shown")
    spawn("first", BOX, (1.0, 0.0, 0.5))
    until(lambda: "/world/first/link" in browser.nodes, "its model")
    process = psutil.Process(pid_of("/gazebo"))
    process.suspend()
    until(lambda: "has not responded for" in browser.text(), "the silence is named")
    process.resume()
    until(lambda: "real time factor" in browser.text(), "the time is shown again")
    process.kill()
    until(lambda: "has not responded for" in browser.text(), "the end is named")
    launch.stop()
    ros_session.launch(WORLD)
    until(lambda: "real time factor" in browser.text(), "its successor is named", 60.0)
    spawn("successor", BALL, (0.0, 0.0, 2.0))
    until(lambda: "/world/successor/link" in browser.nodes, "the model of the successor")
    until(lambda: "/world/first/link" not in browser.nodes, "the model of the killed simulation is gone")
    browser.close()
