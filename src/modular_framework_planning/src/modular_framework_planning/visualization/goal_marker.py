# SPDX-License-Identifier: BSD-3-Clause
"""The interactive markers for the goal in RViz, at the tip and at a moving base, and their menu."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import rospy
from geometry_msgs.msg import Pose, Quaternion
from interactive_markers.interactive_marker_server import InteractiveMarkerServer
from interactive_markers.menu_handler import MenuHandler
from visualization_msgs.msg import (
    InteractiveMarker,
    InteractiveMarkerControl,
    InteractiveMarkerFeedback,
    Marker,
)

GOAL, BASE = "goal", "base"  # names of the markers
HALF = math.sqrt(0.5)
AXES = {"x": Quaternion(HALF, 0, 0, HALF), "y": Quaternion(0, HALF, 0, HALF), "z": Quaternion(0, 0, HALF, HALF)}


@dataclass(frozen=True, slots=True)
class Choice:
    """A submenu with one checked entry.

    Attributes:
        title: Title of the submenu.
        entries: Titles of the entries.
        select: Function called with the title of the chosen entry.
    """

    title: str
    entries: Sequence[str]
    select: Callable[[str], None]


SIX_DOF_CONTROLS = tuple(
    (f"{name}_{axis}", mode, orientation)
    for axis, orientation in AXES.items()
    for name, mode in (
        ("move", InteractiveMarkerControl.MOVE_AXIS),
        ("rotate", InteractiveMarkerControl.ROTATE_AXIS),
    )
)
PLANAR_CONTROLS = (  # in RViz, the x axis of a control is the normal of its plane and its rotation axis
    ("move_x", InteractiveMarkerControl.MOVE_AXIS, Quaternion(0, 0, 0, 1)),
    ("move_y", InteractiveMarkerControl.MOVE_AXIS, AXES["z"]),
    ("move_plane", InteractiveMarkerControl.MOVE_PLANE, AXES["y"]),
    ("rotate_z", InteractiveMarkerControl.ROTATE_AXIS, AXES["y"]),
)
Controls = tuple[tuple[str, int, Quaternion], ...]


class GoalMarker:
    """Interactive markers with individual controls and a common menu.

    Changes of markers become visible together at the next `apply`.

    Publishes and subscribes: <topic>/update, <topic>/update_full, <topic>/feedback (interactive_markers).
    """

    def __init__(self, topic: str, on_drag: Callable[[str, Pose], None]) -> None:
        """Opens the topics.

        Args:
            topic: Prefix of the topic names.
            on_drag: Function called with a marker's name and new pose, in the frame of `show`.
        """
        self._server = InteractiveMarkerServer(topic)
        self._menu = MenuHandler()
        self._on_drag = on_drag

    def fill_menu(self, commands: Sequence[tuple[str, Callable[[], None]]], choices: Sequence[Choice]) -> None:
        """Replaces the menu; the first entry of each choice is checked."""
        self._menu = MenuHandler()
        for title, command in commands:
            self._menu.insert(title, callback=lambda _, run=command: run())
        for choice in choices:
            parent = self._menu.insert(choice.title)
            handles: dict[int, str] = {}
            for index, entry in enumerate(choice.entries):
                handle = self._menu.insert(entry, parent=parent, callback=self._selector(choice, handles))
                handles[handle] = entry
                self._menu.setCheckState(handle, MenuHandler.CHECKED if index == 0 else MenuHandler.UNCHECKED)

        for name in self._shown_controls():
            self._menu.apply(self._server, name)
        self._server.applyChanges()

    def _shown_controls(self) -> list[str]:
        return [name for name in (GOAL, BASE) if self._server.get(name) is not None]

    def _selector(self, choice: Choice, handles: dict[int, str]) -> Callable[[Any], None]:
        menu = self._menu

        def select(feedback: Any) -> None:
            for handle in handles:
                menu.setCheckState(
                    handle, MenuHandler.CHECKED if handle == feedback.menu_entry_id else MenuHandler.UNCHECKED
                )
            menu.reApply(self._server)
            self._server.applyChanges()
            choice.select(handles[feedback.menu_entry_id])

        return select

    def show(self, name: str, frame: str, pose: Pose, scale_m: float, controls: Controls = SIX_DOF_CONTROLS) -> None:
        """Shows or replaces a marker at the next `apply`.

        Args:
            name: Name of the marker.
            frame: Frame of the pose.
            pose: Pose of the marker.
            scale_m: Size of the marker.
            controls: Name, interaction mode and orientation of each control.
        """
        marker = InteractiveMarker(name=name, description="", pose=pose, scale=scale_m)
        marker.header.frame_id = frame
        sphere = Marker(type=Marker.SPHERE)
        sphere.scale.x = sphere.scale.y = sphere.scale.z = 0.25 * scale_m
        sphere.color.r, sphere.color.g, sphere.color.b, sphere.color.a = 0.2, 0.6, 1.0, 0.6
        marker.controls.append(
            InteractiveMarkerControl(name="menu", interaction_mode=InteractiveMarkerControl.MENU, markers=[sphere])
        )
        marker.controls += [
            InteractiveMarkerControl(name=control, orientation=orientation, interaction_mode=mode)
            for control, mode, orientation in controls
        ]
        self._server.insert(marker, self._on_feedback)
        self._menu.apply(self._server, name)

    def hide(self, name: str) -> None:
        """Removes a marker at the next `apply`; has no effect on a hidden marker."""
        self._server.erase(name)

    def move(self, name: str, pose: Pose) -> None:
        """Moves a marker at the next `apply`; has no effect on a hidden marker."""
        if name in self._shown_controls():
            self._server.setPose(name, pose)

    def apply(self) -> None:
        """Publishes the changes since the last call."""
        self._server.applyChanges()

    def _on_feedback(self, feedback: InteractiveMarkerFeedback) -> None:
        if feedback.event_type == InteractiveMarkerFeedback.MOUSE_UP:
            self._server.applyChanges()  # shows the dragged pose to other viewers
        if feedback.event_type != InteractiveMarkerFeedback.POSE_UPDATE:
            return
        p, q = feedback.pose.position, feedback.pose.orientation
        if not all(math.isfinite(value) for value in (p.x, p.y, p.z, q.x, q.y, q.z, q.w)):
            rospy.logwarn_throttle(5.0, "interactive goal: ignored a dragged pose that is not finite")
            return
        self._on_drag(feedback.marker_name, feedback.pose)
