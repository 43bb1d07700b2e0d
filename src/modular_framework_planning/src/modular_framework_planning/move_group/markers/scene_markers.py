# SPDX-License-Identifier: BSD-3-Clause
"""Markers of the planning scene and planned path, for an RViz without MoveIt's plugin."""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pinocchio as pin
import rospy
from geometry_msgs.msg import Point
from moveit_msgs.msg import DisplayTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from modular_framework_planning.contacts import Contact
from modular_framework_planning.geometry.shapes import Box, Cone, Cylinder, Mesh, Plane, Shape, Sphere
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.messages.poses import pose_message
from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.planning_interface.planning_request import PlanningResult
from modular_framework_planning.planning_scene.planning_scene import Color, PlanningScene
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel
from modular_framework_ros.publishing import PicturePublisher, publish

OBJECT_COLOR = (0.45, 0.75, 0.35, 1.0)  # opaque: RViz does not sort transparent markers by depth
ATTACHED_COLOR = (0.75, 0.3, 0.75, 1.0)
GHOST_COLOR = (1.0, 0.6, 0.1)
GHOST_ALPHA = 0.6
FIXED = 1.0e-4  # [m, rad]; a link that moves less relative to the tip is part of the hand
LINE_POINTS = 60
PLANE_SIZE_M = 3.0
CONTACT_COLOR = (1.0, 0.0, 0.0, 0.8)
CONTACT_SIZE_M = 0.05


class MarkerPublisher:
    """Publishes ~planning_scene_markers, ~display_planned_path, ~display_planned_path_markers, ~display_contacts.

    All topics are latched.
    """

    def __init__(self, planning_frame: str) -> None:
        """Advertises the topics.

        Args:
            planning_frame: Frame of contacts and paths.
        """
        self._frame = planning_frame
        self._contacts = rospy.Publisher(names.DISPLAY_CONTACTS_TOPIC, MarkerArray, queue_size=5, latch=True)
        self._scene = PicturePublisher(names.SCENE_MARKERS_TOPIC, MarkerArray)
        self._path = PicturePublisher(names.PATH_MARKERS_TOPIC, MarkerArray)
        self._display = rospy.Publisher(names.DISPLAY_PATH_TOPIC, DisplayTrajectory, queue_size=5, latch=True)
        self._motions: list[list[Marker]] = []
        self._motions_changing = threading.Lock()

    def show_scene(self, scene: PlanningScene) -> None:
        """Publishes one marker per shape; markers of attached objects are in the link's frame and follow the link."""
        self._scene.show(lambda: self._scene_markers(scene))

    def _scene_markers(self, scene: PlanningScene) -> MarkerArray:
        markers = [delete_all(self._frame)]
        for body in scene.objects.values():
            color = scene.colors.get(body.name, OBJECT_COLOR)
            for index, (shape, pose) in enumerate(body.shapes):
                markers.append(_shape_marker(shape, body.pose * pose, scene.model.planning_frame, body.name, index))
                _paint(markers[-1], color)
        for held in scene.attached.values():
            for index, (shape, pose) in enumerate(held.body.shapes):
                markers.append(_shape_marker(shape, held.body.pose * pose, held.link, held.name, index))
                markers[-1].frame_locked = True
                _paint(markers[-1], scene.colors.get(held.name, ATTACHED_COLOR))
        return MarkerArray(markers)

    def show_path(self, scene: PlanningScene, response: Any, answer: PlanningResult) -> None:
        """Publishes a planned motion: the path of the tip as a line, and the hand at the end of the motion.

        Args:
            scene: Planning scene.
            response: moveit_msgs/MotionPlanResponse.
            answer: Planned motion.
        """
        publish(self._display, DisplayTrajectory(scene.model.name, [response.trajectory], response.trajectory_start))
        group = scene.model.group(response.group_name)
        self._path.show(lambda: self._path_markers(scene.model, group, answer))

    def _path_markers(self, model: RobotModel, group: JointGroup, answer: PlanningResult) -> MarkerArray:
        rows = answer.trajectory.positions
        line = _tip_line(model, group.tip_link or group.links[-1], group.indices, rows, answer.start)
        end = answer.start.copy()
        end[group.indices] = rows[-1]
        hand = _hand_links(model, group, answer.start, end)
        ghost = robot_markers(model, end, "ghost", (*GHOST_COLOR, GHOST_ALPHA), hand)
        return marker_array_message([*line, *ghost], self._frame)

    @contextmanager
    def shown_motion(self, scene: PlanningScene, joints: Sequence[str], rows: Array) -> Iterator[None]:
        """Shows the tip path of a running motion as a line, in place of the plan, until the context ends.

        Args:
            scene: Scene at the start of the motion.
            joints: Joints of the motion; no line is drawn unless a planning group has exactly these joints.
            rows: Positions of the joints, shape (n, joints) [rad or m].
        """
        moved = {scene.model.index[name] for name in joints}
        groups = (group for group in scene.model.groups.values() if group.is_chain and set(group.indices) == moved)
        line: list[Marker] = []
        if (group := next(groups, None)) is not None:
            indices = np.array([scene.model.index[name] for name in joints])
            line = _tip_line(scene.model, group.tip_link, indices, rows, scene.positions)
        self._change_motions(line, begins=True)
        try:
            yield
        finally:
            self._change_motions(line, begins=False)

    def _change_motions(self, line: list[Marker], begins: bool) -> None:
        with self._motions_changing:
            self._motions = [other for other in self._motions if other is not line] + ([line] if begins else [])
            markers = [marker for other in self._motions for marker in other]
            self._path.show(lambda: marker_array_message(markers, self._frame))

    def show_contacts(self, contacts: Sequence[Contact]) -> None:
        """Replaces the shown contacts by spheres, whose namespaces name the two bodies."""
        markers = [delete_all(self._frame)]
        for index, contact in enumerate(contacts):
            marker = _marker(Marker.SPHERE, self._frame, f"{contact.first.name}={contact.second.name}", index)
            marker.pose.position = Point(*(float(value) for value in contact.position))
            marker.scale.x = marker.scale.y = marker.scale.z = CONTACT_SIZE_M
            _paint(marker, CONTACT_COLOR)
            markers.append(marker)
        publish(self._contacts, MarkerArray(markers))


def _paint(marker: Marker, color: tuple[float, float, float, float]) -> None:
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = color


def _marker(kind: int, frame: str, namespace: str, marker_id: int = 0) -> Marker:
    marker = Marker(type=kind, ns=namespace, id=marker_id, action=Marker.ADD)
    marker.header.frame_id = frame
    marker.pose.orientation.w = 1.0
    return marker


def _shape_marker(shape: Shape, pose: Transform, frame: str, namespace: str, marker_id: int) -> Marker:
    match shape:
        case Box():
            marker, scale = _marker(Marker.CUBE, frame, namespace, marker_id), (shape.x, shape.y, shape.z)
        case Sphere():
            marker, scale = _marker(Marker.SPHERE, frame, namespace, marker_id), (2.0 * shape.radius,) * 3
        case Cylinder():
            marker = _marker(Marker.CYLINDER, frame, namespace, marker_id)
            scale = (2.0 * shape.radius, 2.0 * shape.radius, shape.height)
        case Cone():
            marker, scale = _marker(Marker.TRIANGLE_LIST, frame, namespace, marker_id), (1.0, 1.0, 1.0)
            marker.points = _cone_points(shape)
        case Plane():
            return _plane_marker(shape, pose, frame, namespace, marker_id)
        case Mesh():
            marker, scale = _marker(Marker.TRIANGLE_LIST, frame, namespace, marker_id), (1.0, 1.0, 1.0)
            marker.points = [Point(*row) for row in shape.vertices[shape.triangles].reshape(-1, 3)]
        case _:
            raise TypeError(f"a shape of type {type(shape).__name__} has no marker")
    marker.pose = pose_message(pose)
    marker.scale.x, marker.scale.y, marker.scale.z = scale
    return marker


def _cone_points(cone: Cone, sides: int = 24) -> list[Point]:
    """Returns the triangles of a cone's side and base."""
    angles = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    rim = [
        Point(cone.radius * x, cone.radius * y, -cone.height / 2)
        for x, y in zip(np.cos(angles), np.sin(angles), strict=True)
    ]
    tip, base_centre = Point(0.0, 0.0, cone.height / 2), Point(0.0, 0.0, -cone.height / 2)
    return [
        point
        for first, second in zip(rim[:-1], rim[1:], strict=True)
        for point in (first, second, tip, second, first, base_centre)
    ]


def _plane_marker(shape: Plane, pose: Transform, frame: str, namespace: str, marker_id: int) -> Marker:
    """Returns a thin square around the plane's point nearest to the origin of its frame."""
    normal = np.array([shape.a, shape.b, shape.c])
    length = float(np.linalg.norm(normal))
    rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal / length).toRotationMatrix()
    marker = _marker(Marker.CUBE, frame, namespace, marker_id)
    marker.pose = pose_message(pose * pin.SE3(rotation, -shape.d / length * normal / length))
    marker.scale.x, marker.scale.y, marker.scale.z = PLANE_SIZE_M, PLANE_SIZE_M, 0.001
    return marker


def _tip_line(model: RobotModel, link: str, indices: Array, rows: Array, start: Array) -> list[Marker]:
    """Returns the path of a link as a line, or nothing for a single point, which RViz reports as an error."""
    if len(rows) < 2:
        return []
    line = _marker(Marker.LINE_STRIP, model.planning_frame, "tip")
    line.scale.x = 0.006
    _paint(line, (*GHOST_COLOR, 1.0))
    frame, data, positions = model.frame_ids[link], model.pin_model.createData(), start.copy()
    for row in np.linspace(0, len(rows) - 1, min(len(rows), LINE_POINTS)).round().astype(int):
        positions[indices] = rows[row]
        pin.forwardKinematics(model.pin_model, data, positions)
        line.points.append(Point(*pin.updateFramePlacement(model.pin_model, data, frame).translation))
    return [line]


def delete_all(frame: str) -> Marker:
    """Returns the marker that deletes all markers of a topic, for the front of a message.

    Args:
        frame: Any known frame; RViz would process a marker without a frame before markers of earlier messages.
    """
    marker = Marker(action=Marker.DELETEALL)
    marker.header.frame_id = frame
    return marker


def marker_array_message(markers: Sequence[Marker], frame: str) -> MarkerArray:
    """Returns the message that replaces all markers of a topic by these markers; `frame` is any known frame."""
    for index, marker in enumerate(markers):
        marker.id = index
    return MarkerArray([delete_all(frame), *markers])


def _hand_links(model: RobotModel, group: JointGroup, start: Array, end: Array) -> set[str]:
    """Returns the links that do not move relative to the group's tip; all links if the group has no tip."""
    before, after = model.link_transforms(start), model.link_transforms(end)
    tip = group.tip_link
    if not tip:
        return set(after)
    return {
        link
        for link, pose in after.items()
        if before[tip].actInv(before[link]).isApprox(after[tip].actInv(pose), FIXED)
    }


def robot_markers(
    model: RobotModel, positions: Array, namespace: str, color: Color, links: Collection[str] | None = None
) -> list[Marker]:
    """Returns markers of the visual geometry of links in one colour, without unique ids.

    Args:
        model: Robot model.
        positions: Positions of all joints [rad or m].
        namespace: Namespace of the markers.
        color: Red, green, blue and alpha, 0 to 1.
        links: Links to show; None for all links.
    """
    transforms = model.link_transforms(positions)
    shown = transforms.keys() if links is None else links
    frame = model.planning_frame
    markers = [
        _shape_marker(shape, transforms[link] * origin, frame, namespace, 0)
        for link, shapes in model.document.visual_shapes.items()
        if link in shown
        for shape, origin in shapes
    ]
    for link, visuals in model.document.visual_meshes.items():
        for uri, origin, scale in visuals if link in shown else ():
            marker = _marker(Marker.MESH_RESOURCE, frame, namespace)
            marker.mesh_resource = uri
            marker.pose = pose_message(transforms[link] * origin)
            marker.scale.x, marker.scale.y, marker.scale.z = scale
            markers.append(marker)
    for marker in markers:
        _paint(marker, color)
    return markers
