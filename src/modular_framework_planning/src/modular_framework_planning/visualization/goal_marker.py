# SPDX-License-Identifier: BSD-3-Clause
"""The interactive marker that sets the goal pose of the tip in RViz, and its menu."""

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

NAME = "goal"
HALF = math.sqrt(0.5)
AXES = {"x": Quaternion(HALF, 0, 0, HALF), "y": Quaternion(0, HALF, 0, HALF), "z": Quaternion(0, 0, HALF, HALF)}


@dataclass(frozen=True, slots=True)
class Choice:
    """A list of entries of which one is ticked."""

    title: str
    entries: Sequence[str]
    select: Callable[[str], None]


class GoalMarker:
    """An interactive marker with six degrees of freedom and a menu.

    Publishes and subscribes: <topic>/update, <topic>/update_full, <topic>/feedback (interactive_markers).
    """

    def __init__(self, topic: str, on_drag: Callable[[Pose], None]) -> None:
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

        if self._server.get(NAME) is not None:
            self._menu.apply(self._server, NAME)
            self._server.applyChanges()

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

    def show(self, frame: str, pose: Pose, scale_m: float) -> None:
        """Shows the marker, or moves it to another pose and resets it."""
        marker = InteractiveMarker(name=NAME, description="", pose=pose, scale=scale_m)
        marker.header.frame_id = frame
        ball = Marker(type=Marker.SPHERE)
        ball.scale.x = ball.scale.y = ball.scale.z = 0.25 * scale_m
        ball.color.r, ball.color.g, ball.color.b, ball.color.a = 0.2, 0.6, 1.0, 0.6
        marker.controls.append(
            InteractiveMarkerControl(
                name="menu", interaction_mode=InteractiveMarkerControl.MENU, always_visible=True, markers=[ball]
            )
        )
        for axis, turn in AXES.items():
            for name, mode in (
                ("move", InteractiveMarkerControl.MOVE_AXIS),
                ("rotate", InteractiveMarkerControl.ROTATE_AXIS),
            ):
                marker.controls.append(
                    InteractiveMarkerControl(name=f"{name}_{axis}", orientation=turn, interaction_mode=mode)
                )
        self._server.insert(marker, self._on_feedback)
        self._menu.apply(self._server, NAME)
        self._server.applyChanges()

    def move(self, pose: Pose) -> None:
        """Puts the marker elsewhere."""
        self._server.setPose(NAME, pose)
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
        self._on_drag(feedback.pose)
