# SPDX-License-Identifier: BSD-3-Clause
"""What the viewer makes of messages: poses of links, objects of the planning scene, plans, pictures, shapes to draw."""

from __future__ import annotations

import io
import math
import socket
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pinocchio
import pytest
import rospy
import trimesh
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMsg
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, DisplayTrajectory, PlanningScene, RobotTrajectory
from PIL import Image as PillowImage
from sensor_msgs.msg import Image
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.sensors import scene_text
from modular_framework_simulation.viewer.glb_files import bodies_of_visuals, glb_of, pose_matrix
from modular_framework_simulation.viewer.layers import Layer, Look, tree_name
from modular_framework_simulation.viewer.pictures import picture_of
from modular_framework_simulation.viewer.plan_playback import Plan, plan_of
from modular_framework_simulation.viewer.planning_scene_objects import PlanningSceneObjects
from modular_framework_simulation.viewer.planning_scene_view import PlanningSceneView
from modular_framework_simulation.viewer.robot_links import RobotLinks, finite_positions
from modular_framework_simulation.viewer.robot_view import PlanView, RobotView
from modular_framework_simulation.viewer.web_server import AddressError, free_port
from modular_framework_simulation.viewer.world_view import RealTimeFactor, WorldView
from modular_framework_urdf.urdf_reader import read_urdf

ARM = """<robot name="arm">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="slide"/><link name="flange"/>
  <link name="finger_1"/><link name="finger_2"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0.1 0 0.3" rpy="0.2 -0.4 1"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.4"/>
    <axis xyz="1 0 0"/></joint>
  <joint name="reach" type="prismatic"><parent link="fore"/><child link="slide"/><origin rpy="0 1 0"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="bolt" type="fixed"><parent link="slide"/><child link="flange"/>
    <origin xyz="0 0.05 0" rpy="1 0 0"/></joint>
  <joint name="grip" type="prismatic"><parent link="flange"/><child link="finger_1"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="follow" type="prismatic"><parent link="flange"/><child link="finger_2"/><axis xyz="-1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="grip" multiplier="0.5" offset="0.01"/></joint>
</robot>"""


def visual(geometry: specs.Geometry, pose: Pose = Pose(), **more: Any) -> specs.Visual:  # noqa: B008  (frozen)
    return specs.Visual("seen", pose, geometry, more.pop("colour", (1.0, 0.0, 0.0, 1.0)), **more)


# scene as text


@pytest.mark.parametrize(
    "geometry",
    [
        specs.Box((0.1, 0.2, 0.3)),
        specs.Cylinder(0.1, 0.25),
        specs.Sphere(0.05),
        specs.Plane((0.0, 0.0, 1.0), (100.0, 50.0)),
        specs.Mesh(Path("/a mesh.dae"), (1.0, -1.0, 0.001), "part", True),
    ],
)
def test_models_and_poses_come_through_text_as_they_are(geometry: specs.Geometry) -> None:
    pose = Pose.from_xyz_rpy((0.1, -2.0, 1e-7), (0.3, 0.2, 0.1))
    seen = visual(geometry, pose, texture=Path("/wood.png"), own_materials=True)
    models = (scene_text.VisibleModel(7, "ta/ble ü", (scene_text.VisibleLink("link", (seen, visual(geometry))),)),)
    assert scene_text.models_from_text(scene_text.models_to_text(models)) == models
    text = scene_text.poses_to_text(scene_text.ScenePoses(123456789012345, True, {7: (pose, Pose())}))
    poses = scene_text.poses_from_text(text)
    assert (poses.time_ns, poses.paused) == (123456789012345, True)
    assert poses.poses[7][0].distance_to(pose) == pytest.approx((0.0, 0.0), abs=1e-7)


@pytest.mark.parametrize(
    "text",
    ["", "no json", "7", "[7]", '[{"number": 1}]', "{}", '{"time_ns": 1, "paused": false, "poses": {"1": [[1, 2]]}}',
     '{"time_ns": 1, "paused": false, "poses": {"1": [[0, 0, 0, 9, 0, 0, 0]]}}', '{"poses": []}',
     '[{"number": 1, "name": "a", "links": [{"name": "l", "visuals": [{"name": "v", "pose": [0,0,0,0,0,0,1], '
     '"geometry": {"shape": "torus"}, "colour": [1,1,1,1], "texture": null, "own_materials": false}]}]}]'],
)  # fmt: skip
def test_other_texts_are_refused(text: str) -> None:
    for read in (scene_text.models_from_text, scene_text.poses_from_text):
        if text in ("{}",) and read is scene_text.models_from_text:
            continue  # no model at all
        with pytest.raises(ValueError, match="visible models"):
            read(text)


# robot


def test_links_are_where_pinocchio_has_them() -> None:
    links, model = RobotLinks(read_urdf(ARM)), pinocchio.buildModelFromXML(ARM)
    data = model.createData()
    random = np.random.default_rng(5)
    for _ in range(20):
        values = dict(zip(("shoulder", "elbow", "reach", "grip"), random.uniform(-2, 2, 4), strict=True))
        expected = {**values, "follow": 0.5 * values["grip"] + 0.01}
        q = pinocchio.neutral(model)
        for name, value in expected.items():
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = [math.cos(value), math.sin(value)] if joint.nq == 2 else [value]
        pinocchio.framesForwardKinematics(model, data, q)
        found = links.poses(values)
        assert len(found) == 7
        for name, pose in found.items():
            frame = data.oMf[model.getFrameId(name)].homogeneous
            assert pose_matrix(pose) == pytest.approx(frame, abs=1e-9), name


def test_the_tip_and_what_joints_carry_follow_from_the_description() -> None:
    links = RobotLinks(read_urdf(ARM))
    assert (links.root, links.tip(("elbow", "shoulder")), links.tip(("grip",))) == ("base", "fore", "finger_1")
    assert links.tip(("unknown",)) == "base"
    assert links.carried_by(("reach",)) == {"slide", "flange", "finger_1", "finger_2"}
    assert links.carried_by(("grip",)) == {"finger_1", "finger_2"}


def test_descriptions_without_one_root_are_refused() -> None:
    with pytest.raises(DescriptionError, match="2 root links"):
        RobotLinks(read_urdf('<robot name="r"><link name="a"/><link name="b"/></robot>'))


def test_joint_states_lose_what_is_not_finite_and_are_refused_where_numbers_are_missing() -> None:
    assert finite_positions(["a", "b", "c"], [1.0, math.nan, -2.0]) == {"a": 1.0, "c": -2.0}
    with pytest.raises(ValueError, match="2 joints have 1 positions"):
        finite_positions(["a", "b"], [1.0])


# planning scene


def collision_object(name: str, operation: int = CollisionObject.ADD, x: float = 0.0) -> CollisionObject:
    item = CollisionObject(id=name, operation=operation)
    item.header.frame_id = "world"
    item.pose = PoseMsg(Point(x, 0, 0), Quaternion(0, 0, 0, 1))
    if operation in (CollisionObject.ADD, CollisionObject.APPEND):
        item.primitives = [SolidPrimitive(SolidPrimitive.BOX, [0.2, 0.4, 0.6])]
        item.primitive_poses = [PoseMsg(Point(0, 0, 1), Quaternion(0, 0, 0, 1))]
    return item


def scene(*items: CollisionObject, attached: tuple[AttachedCollisionObject, ...] = (), diff: bool = True) -> Any:
    message = PlanningScene(is_diff=diff)
    message.robot_state.is_diff = diff
    message.world.collision_objects = list(items)
    message.robot_state.attached_collision_objects = list(attached)
    return message


def held(name: str, link: str, operation: int = CollisionObject.ADD) -> AttachedCollisionObject:
    item = AttachedCollisionObject(link_name=link, object=collision_object(name, operation))
    item.object.header.frame_id = link
    return item


def test_objects_come_move_and_go_as_the_messages_say() -> None:
    objects = PlanningSceneObjects()
    assert objects.apply(scene(collision_object("a", x=1.0), collision_object("b"), diff=False)) == []
    (pose, body), *_ = objects.objects["a"].bodies
    assert (objects.objects["a"].pose.position, pose.position) == ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert np.ptp(body.vertices, axis=0) == pytest.approx((0.2, 0.4, 0.6))
    objects.apply(scene(collision_object("a", CollisionObject.MOVE, x=3.0)))
    assert objects.objects["a"].pose.position == (3.0, 0.0, 0.0) and len(objects.objects["a"].bodies) == 1
    objects.apply(scene(collision_object("a", CollisionObject.APPEND)))
    assert len(objects.objects["a"].bodies) == 2
    objects.apply(scene(collision_object("b", CollisionObject.REMOVE)))
    assert list(objects.objects) == ["a"]
    objects.apply(scene(collision_object("", CollisionObject.REMOVE)))
    assert objects.objects == {}


def test_a_grasped_object_goes_with_the_hand_and_comes_back() -> None:
    objects = PlanningSceneObjects()
    objects.apply(scene(collision_object("cup"), diff=False))
    objects.apply(scene(collision_object("cup", CollisionObject.REMOVE), attached=(held("cup", "hand"),)))
    assert (objects.objects["cup"].attached, objects.objects["cup"].frame) == (True, "hand")
    objects.apply(scene(collision_object("cup", CollisionObject.REMOVE)))  # of the world, where it is no longer
    assert "cup" in objects.objects
    objects.apply(scene(attached=(held("cup", "hand", CollisionObject.REMOVE),)))
    assert objects.objects == {}
    objects.apply(scene(attached=(held("cup", "hand"),)))
    objects.apply(scene(collision_object("cup"), attached=(held("cup", "hand", CollisionObject.REMOVE),)))
    assert not objects.objects["cup"].attached
    objects.apply(scene(collision_object("other"), diff=False))
    assert list(objects.objects) == ["other"]


def test_every_shape_has_its_size() -> None:
    item = CollisionObject(id="all", operation=CollisionObject.ADD)
    item.primitives = [
        SolidPrimitive(SolidPrimitive.SPHERE, [0.5]),
        SolidPrimitive(SolidPrimitive.CYLINDER, [2.0, 0.25]),
        SolidPrimitive(SolidPrimitive.CONE, [2.0, 0.25]),
    ]
    item.meshes = [Mesh([MeshTriangle([0, 1, 2])], [Point(0, 0, 0), Point(1, 0, 0), Point(0, 3, 0)])]
    item.planes = [Plane([0, 0, 2.0, -4.0])]
    objects = PlanningSceneObjects()
    assert objects.apply(scene(item)) == []
    sphere, cylinder, cone, mesh, plane = (body for _, body in objects.objects["all"].bodies)
    assert np.ptp(sphere.vertices, axis=0) == pytest.approx((1, 1, 1), abs=0.01)
    assert np.ptp(cylinder.vertices, axis=0) == pytest.approx((0.5, 0.5, 2.0), abs=0.01)
    assert np.ptp(cone.vertices, axis=0) == pytest.approx((0.5, 0.5, 2.0), abs=0.01)
    assert abs(trimesh.Trimesh(cone.vertices, cone.triangles).volume) == pytest.approx(
        math.pi * 0.25**2 * 2 / 3, rel=0.02
    )
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx((1, 3, 0))
    assert plane.vertices[:, 2] == pytest.approx(2.0)  # 2 z - 4 = 0


def spoiled(change: Any) -> CollisionObject:
    item = collision_object("bad")
    change(item)
    return item


@pytest.mark.parametrize(
    "change",
    [
        lambda item: item.primitives[0].dimensions.pop(),
        lambda item: item.primitives[0].dimensions.__setitem__(0, math.nan),
        lambda item: setattr(item.primitives[0], "type", 77),
        lambda item: setattr(item.pose.position, "x", math.inf),
        lambda item: setattr(item.pose.orientation, "w", 9.0),
        lambda item: item.primitive_poses.append(PoseMsg()),
        lambda item: item.meshes.append(Mesh([MeshTriangle([0, 1, 9])], [Point()])),
        lambda item: item.planes.append(Plane([0, 0, 0, 1])),
    ],
)
def test_a_bad_object_is_named_and_harms_no_other(change: Any) -> None:
    objects = PlanningSceneObjects()
    (fault,) = objects.apply(scene(collision_object("a"), spoiled(change), collision_object("b")))
    assert "'bad'" in fault and set(objects.objects) == {"a", "b"}


def test_a_move_of_an_unknown_object_is_named() -> None:
    (fault,) = PlanningSceneObjects().apply(scene(collision_object("ghost", CollisionObject.MOVE)))
    assert "does not exist" in fault


# plans


def trajectory(joints: list[str], *points: tuple[float, list[float]]) -> RobotTrajectory:
    part = RobotTrajectory()
    part.joint_trajectory.joint_names = joints
    part.joint_trajectory.points = [
        JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration.from_sec(time))
        for time, positions in points
    ]
    return part


def displayed(*parts: RobotTrajectory) -> DisplayTrajectory:
    message = DisplayTrajectory(trajectory=list(parts))
    message.trajectory_start.joint_state.name = ["shoulder", "elbow", "reach", "grip"]
    message.trajectory_start.joint_state.position = [0.0, 0.5, 0.1, 0.02]
    return message


def test_a_plan_of_two_parts_is_one_motion_and_other_joints_stay() -> None:
    parts = trajectory(["shoulder"], (0, [0.0]), (2, [1.0])), trajectory(["grip"], (0, [0.02]), (1, [0.0]))
    plan = plan_of(displayed(*parts))
    assert plan is not None and plan.duration_s == pytest.approx(3.0)
    assert plan.positions_at(1.0) == pytest.approx({"shoulder": 0.5, "elbow": 0.5, "reach": 0.1, "grip": 0.02})
    assert plan.positions_at(2.5) == pytest.approx({"shoulder": 1.0, "elbow": 0.5, "reach": 0.1, "grip": 0.01})
    assert plan.positions_at(99.0)["grip"] == pytest.approx(0.0)


def test_the_line_of_a_plan_goes_from_the_first_to_the_last_pose_of_the_tip() -> None:
    links = RobotLinks(read_urdf(ARM))
    plan = plan_of(displayed(trajectory(["shoulder", "elbow"], (0, [0.0, 0.5]), (1, [1.0, -0.5]))))
    assert plan is not None
    line = plan.line(links)
    for index, values in ((0, (0.0, 0.5)), (-1, (1.0, -0.5))):
        expected = links.poses({**plan.start, **dict(zip(("shoulder", "elbow"), values, strict=True))})["fore"]
        assert line[index] == pytest.approx(expected.position)


def test_a_plan_without_times_is_shown_and_one_whose_times_decrease_is_refused() -> None:
    plan = plan_of(displayed(trajectory(["elbow"], (0, [0.0]), (0, [1.0]), (0, [2.0]))))
    assert plan is not None and plan.duration_s > 0
    assert plan_of(DisplayTrajectory()) is None
    with pytest.raises(ValueError, match="decrease"):
        plan_of(displayed(trajectory(["elbow"], (1, [0.0]), (0.5, [1.0]))))
    with pytest.raises(ValueError, match="1 joints have 2 positions"):
        plan_of(displayed(trajectory(["elbow"], (1, [0.0, 1.0]))))


# pictures


def image(encoding: str, pixels: np.ndarray, padding: int = 0) -> Image:
    rows = pixels.reshape(len(pixels), -1).view(np.uint8)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return Image(
        encoding=encoding, height=len(pixels), width=pixels.shape[1], step=rows.shape[1], data=rows.tobytes()
    )  # fmt: skip


def test_colours_are_those_of_the_encoding() -> None:
    rgb = np.array([[[255, 0, 10], [1, 2, 3]]], np.uint8)
    assert (picture_of(image("rgb8", rgb, padding=3)) == rgb).all()
    assert (picture_of(image("bgr8", rgb[..., ::-1].copy())) == rgb).all()
    bgra = np.concatenate([rgb[..., ::-1], np.full((1, 2, 1), 9, np.uint8)], axis=2)
    assert (picture_of(image("bgra8", bgra)) == rgb).all()
    assert (picture_of(image("mono8", np.array([[7, 9]], np.uint8)))[0, :, 1] == (7, 9)).all()


def test_depth_is_brighter_farther_away_and_black_where_nothing_is_seen() -> None:
    for encoding, kind, nothing in (("32FC1", np.float32, math.nan), ("16UC1", np.uint16, 0)):
        seen = picture_of(image(encoding, np.array([[1, 2, 4, nothing]], dtype=kind)))[0, :, 0].astype(int)
        assert seen[3] == 0 < seen[0] < seen[1] < seen[2] == 255
    assert picture_of(image("32FC1", np.full((2, 2), math.nan, np.float32))).max() == 0


def test_wide_images_are_made_smaller() -> None:
    assert picture_of(image("mono8", np.zeros((1080, 1920), np.uint8))).shape == (360, 640, 3)


@pytest.mark.parametrize(
    "change", [{"encoding": "yuv422"}, {"data": b"12"}, {"width": 0}, {"width": 99}, {"step": 1}, {"height": 0}]
)
def test_images_that_do_not_fit_are_refused(change: dict[str, Any]) -> None:
    message = image("rgb8", np.zeros((2, 2, 3), np.uint8))
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match="image|encoding"):
        picture_of(message)


# shapes to draw


def load(content: bytes | None) -> Any:
    assert content is not None
    return trimesh.load(io.BytesIO(content), file_type="glb")


def test_drawn_shapes_have_the_size_the_place_and_the_colour_of_the_visual(tmp_path: Path) -> None:
    turned = Pose.from_xyz_rpy((1.0, 2.0, 3.0), (0.0, 0.0, math.pi / 2))
    seen = visual(specs.Box((0.2, 0.4, 0.6)), turned, colour=(1.0, 0.5, 0.0, 0.5))
    bodies = bodies_of_visuals([seen], pytest.fail)
    scene = load(glb_of(bodies))
    assert scene.bounds == pytest.approx(np.array([(0.8, 1.9, 2.7), (1.2, 2.1, 3.3)]), abs=1e-6)
    (mesh,) = scene.geometry.values()
    red, green, blue, alpha = np.asarray(mesh.visual.material.baseColorFactor, float) / 255
    assert (red, green, blue, alpha) == pytest.approx((1.0, 0.5**2.2, 0.0, 0.5), abs=0.01)  # linear, as in glTF
    assert mesh.visual.material.alphaMode == "BLEND"
    larger = load(glb_of(bodies, outset_m=0.01))
    assert larger.extents == pytest.approx(scene.extents + 0.02, abs=1e-6)


class KeptShapes:
    """A layer that keeps what is drawn."""

    def __init__(self) -> None:
        self.shapes: dict[str, Any] = {}

    def clear(self) -> None:
        self.shapes.clear()

    def add(self, path: str, content: bytes | None, look: Look = Look.SOLID) -> None:
        self.shapes[path] = load(content)

    def place(self, path: str, pose: Pose) -> None:
        pass


def test_the_ghost_of_a_plan_has_no_surface_in_those_of_the_robot() -> None:
    text = """<robot name="r"><link name="base"/><link name="bar"><visual><geometry><box size="0.2 0.1 0.4"/></geometry>
      </visual></link><joint name="hinge" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    robot_layer, plan_layer = KeptShapes(), KeptShapes()
    robot = RobotView(robot_layer, text, str, pytest.fail)  # type: ignore[arg-type]
    plan = PlanView(plan_layer, MagicMock())  # type: ignore[arg-type]
    plan.show(Plan({}, ("hinge",), np.array([0.0, 1.0]), np.array([[0.0], [1.0]])), robot)
    plan.show_ghost(0.0)
    ghost = plan_layer.shapes["ghost/bar"]
    half = np.array([0.1, 0.05, 0.2])
    mesh = ghost.to_mesh()
    depths = np.abs(mesh.face_normals) @ half - np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles_center)
    assert depths == pytest.approx(0.001, abs=1e-6)


def test_a_mesh_is_drawn_in_metres_with_its_picture(tmp_path: Path) -> None:
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1000 0 0\nv 0 2000 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    )
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd p.png\n")
    PillowImage.new("RGB", (4, 4), (0, 0, 200)).save(tmp_path / "p.png")
    seen = visual(specs.Mesh(tmp_path / "m.obj", (0.001, 0.001, 0.001)), own_materials=True)
    (mesh,) = load(glb_of(bodies_of_visuals([seen], pytest.fail))).geometry.values()
    assert mesh.extents == pytest.approx((1.0, 2.0, 0.0))
    assert mesh.visual.material.baseColorTexture.getpixel((0, 0))[:3] == (0, 0, 200)
    (ghost,) = load(glb_of(bodies_of_visuals([seen], pytest.fail), (0.0, 1.0, 0.0, 0.25))).geometry.values()
    assert ghost.visual.material.baseColorTexture is None
    assert np.asarray(ghost.visual.material.baseColorFactor)[3] == pytest.approx(64, abs=1)


def test_a_shape_that_cannot_be_read_is_named_and_the_others_are_drawn(tmp_path: Path) -> None:
    lines: list[str] = []
    bodies = bodies_of_visuals([visual(specs.Mesh(tmp_path / "no.stl")), visual(specs.Sphere(0.1))], lines.append)
    assert len(bodies) == 1 and len(lines) == 1 and "no.stl" in lines[0]
    assert glb_of([]) is None


# layers


class Node:
    def __init__(self, tree: dict[str, Node], name: str, visible: bool = True) -> None:
        self.tree, self.name, self.visible = tree, name, visible
        self.position: Any = None
        self.wxyz: Any = None
        tree[name] = self

    def remove(self) -> None:
        for name in [name for name in self.tree if name == self.name or name.startswith(f"{self.name}/")]:
            del self.tree[name]


class Server:
    """Keeps the nodes of a scene as viser does."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}
        self.scene = self

    def add_frame(self, name: str, show_axes: bool, visible: bool = True) -> Node:
        return Node(self.nodes, name, visible)

    def add_glb(self, name: str, content: bytes, cast_shadow: bool, receive_shadow: float) -> Node:
        assert content[:4] == b"glTF"
        return Node(self.nodes, name)


def box_model(number: int, name: str) -> scene_text.VisibleModel:
    link = scene_text.VisibleLink("link", (visual(specs.Box((0.1, 0.1, 0.1))),))
    return scene_text.VisibleModel(number, name, (link,))


def test_the_tree_has_the_models_of_the_world_where_they_are() -> None:
    server = Server()
    world = WorldView(Layer(server, "world"), pytest.fail)
    world.show([box_model(1, "a"), box_model(2, "b/c")])
    assert set(server.nodes) == {"/world", "/world/a", "/world/a/link", "/world/b|c", "/world/b|c/link"}
    pose = Pose.from_xyz_rpy((1.0, 2.0, 3.0), (0.0, 0.0, math.pi))
    world.place(scene_text.ScenePoses(0, False, {1: (pose,), 77: (pose,)}))
    node = server.nodes["/world/a/link"]
    assert node.position == (1.0, 2.0, 3.0) and np.abs(node.wxyz) == pytest.approx((0, 0, 0, 1), abs=1e-9)
    world.show([box_model(1, "a")])
    assert server.nodes["/world/a/link"] is node and "/world/b|c" not in server.nodes
    world.show([box_model(3, "a")])
    assert server.nodes["/world/a/link"] is not node


def test_what_rests_is_not_sent_again() -> None:
    server = Server()
    layer = Layer(server, "robot")
    layer.add("hand", glb_of(bodies_of_visuals([visual(specs.Sphere(0.1))], pytest.fail)))
    layer.place("hand", Pose((0.0, 0.0, 1.0)))
    server.nodes["/robot/hand"].position = None
    layer.place("hand", Pose((0.0, 0.0, 1.0 + 1e-9)))
    assert server.nodes["/robot/hand"].position is None
    layer.place("hand", Pose((0.0, 0.0, 1.001)))
    assert server.nodes["/robot/hand"].position == (0.0, 0.0, 1.001)
    layer.visible = False
    assert not server.nodes["/robot"].visible
    layer.clear()
    assert set(server.nodes) == {"/robot"} and layer.paths == ()


def test_held_objects_follow_their_link() -> None:
    server = Server()
    view = PlanningSceneView(Layer(server, "planning scene"), pytest.fail)
    view.apply(scene(collision_object("table", x=2.0), attached=(held("cup", "hand"),), diff=False))
    view.place({"hand": Pose((0.0, 5.0, 0.0))})
    assert server.nodes["/planning scene/cup"].position == (0.0, 5.0, 0.0)
    assert server.nodes["/planning scene/table"].position == (2.0, 0.0, 0.0)
    view.apply(scene(attached=(held("cup", "hand", CollisionObject.REMOVE),)))
    view.place({})
    assert "/planning scene/cup" not in server.nodes
    view.clear()
    assert set(server.nodes) == {"/planning scene"}


def test_names_cannot_leave_their_place_in_the_tree() -> None:
    assert (tree_name("a/../b"), tree_name("")) == ("a|..|b", "(no name)")


def test_the_real_time_factor_is_measured_over_seconds_and_starts_anew_after_a_reset() -> None:
    factor = RealTimeFactor()
    assert factor.value == 0.0
    for index in range(101):
        factor.note(index * 0.1, index * 50_000_000)
    assert factor.value == pytest.approx(0.5)
    for index in range(101):
        factor.note(10.1 + index * 0.1, 5_000_000_000 + index * 200_000_000)
    assert factor.value == pytest.approx(2.0, rel=0.05)
    factor.note(21.0, 0)
    assert factor.value == 0.0


# address


def test_a_taken_port_is_left_for_the_next_free_one_and_a_foreign_address_is_refused() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert port < free_port("127.0.0.1", port) < port + 100
    for host, number in (("192.0.2.1", 8080), ("no such host.", 8080), ("127.0.0.1", 0), ("127.0.0.1", 70000)):
        with pytest.raises(AddressError, match=r"port"):
            free_port(host, number)
