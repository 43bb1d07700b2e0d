# SPDX-License-Identifier: BSD-3-Clause
"""The interactive markers that set the goal in RViz, one at the tip and one at a base that moves, and their menu."""

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
    """A list of entries of which one is ticked."""

    title: str
    entries: Sequence[str]
    select: Callable[[str], None]


SIX_WAYS = tuple(
    (f"{name}_{axis}", mode, turn)
    for axis, turn in AXES.items()
    for name, mode in (
        ("move", InteractiveMarkerControl.MOVE_AXIS),
        ("rotate", InteractiveMarkerControl.ROTATE_AXIS),
    )
)
ON_THE_GROUND = (  # RViz's plane and turn are about the x axis of a control
    ("move_x", InteractiveMarkerControl.MOVE_AXIS, Quaternion(0, 0, 0, 1)),
    ("move_y", InteractiveMarkerControl.MOVE_AXIS, AXES["z"]),
    ("move_plane", InteractiveMarkerControl.MOVE_PLANE, AXES["y"]),
    ("rotate_z", InteractiveMarkerControl.ROTATE_AXIS, AXES["y"]),
)
Ways = tuple[tuple[str, int, Quaternion], ...]


class GoalMarker:
    """Interactive markers, each with the ways in which it can be dragged and all with one menu.

    Viewers see changes of markers at the next `apply`, all at once.

    Publishes and subscribes: <topic>/update, <topic>/update_full, <topic>/feedback (interactive_markers).
    """

    def __init__(self, topic: str, on_drag: Callable[[str, Pose], None]) -> None:
        """Opens the topics.

        Args:
            topic: first part of the names of the topics.
            on_drag: called with the marker's name and its pose in the frame it was shown in.
        """
        self._server = InteractiveMarkerServer(topic)
        self._menu = MenuHandler()
        self._on_drag = on_drag

    def fill_menu(self, commands: Sequence[tuple[str, Callable[[], None]]], choices: Sequence[Choice]) -> None:
        """Sets what the menu offers, in place of what it offered before; the first entry of each choice is ticked."""
        self._menu = MenuHandler()
        for title, command in commands:
            self._menu.insert(title, callback=lambda _, run=command: run())
        for choice in choices:
            parent = self._menu.insert(choice.title)
            handles: dict[int, str] = {}
            for number, entry in enumerate(choice.entries):
                handle = self._menu.insert(entry, parent=parent, callback=self._ticker(choice, handles))
                handles[handle] = entry
                self._menu.setCheckState(handle, MenuHandler.CHECKED if number == 0 else MenuHandler.UNCHECKED)

        for name in self._shown():
            self._menu.apply(self._server, name)
        self._server.applyChanges()

    def _shown(self) -> list[str]:
        return [name for name in (GOAL, BASE) if self._server.get(name) is not None]

    def _ticker(self, choice: Choice, handles: dict[int, str]) -> Callable[[Any], None]:
        menu = self._menu

        def tick(feedback: Any) -> None:
            for handle in handles:
                menu.setCheckState(
                    handle, MenuHandler.CHECKED if handle == feedback.menu_entry_id else MenuHandler.UNCHECKED
                )
            menu.reApply(self._server)
            self._server.applyChanges()
            choice.select(handles[feedback.menu_entry_id])

        return tick

    def show(self, name: str, frame: str, pose: Pose, scale_m: float, ways: Ways = SIX_WAYS) -> None:
        """Shows a marker, or moves it to another pose and resets it, at the next `apply`."""
        marker = InteractiveMarker(name=name, description="", pose=pose, scale=scale_m)
        marker.header.frame_id = frame
        ball = Marker(type=Marker.SPHERE)
        ball.scale.x = ball.scale.y = ball.scale.z = 0.25 * scale_m
        ball.color.r, ball.color.g, ball.color.b, ball.color.a = 0.2, 0.6, 1.0, 0.6
        marker.controls.append(
            InteractiveMarkerControl(name="menu", interaction_mode=InteractiveMarkerControl.MENU, markers=[ball])
        )
        marker.controls += [
            InteractiveMarkerControl(name=way, orientation=turn, interaction_mode=mode) for way, mode, turn in ways
        ]
        self._server.insert(marker, self._on_feedback)
        self._menu.apply(self._server, name)

    def hide(self, name: str) -> None:
        """Takes a marker away at the next `apply`; one that is not shown is no error."""
        self._server.erase(name)

    def move(self, name: str, pose: Pose) -> None:
        """Puts a marker elsewhere at the next `apply`; one that is not shown stays so."""
        if name in self._shown():
            self._server.setPose(name, pose)

    def apply(self) -> None:
        """Publishes the changes since the last call."""
        self._server.applyChanges()

    def _on_feedback(self, feedback: InteractiveMarkerFeedback) -> None:
        if feedback.event_type == InteractiveMarkerFeedback.MOUSE_UP:
            self._server.applyChanges()  # other viewers see where it was dragged to
        if feedback.event_type != InteractiveMarkerFeedback.POSE_UPDATE:
            return
        p, q = feedback.pose.position, feedback.pose.orientation
        if not all(math.isfinite(value) for value in (p.x, p.y, p.z, q.x, q.y, q.z, q.w)):
            rospy.logwarn_throttle(5.0, "interactive goal: a dragged pose with a number that is not finite is ignored")
            return
        self._on_drag(feedback.marker_name, feedback.pose)
