# SPDX-License-Identifier: BSD-3-Clause
"""Control panel beside the scene, with time, layers, replay of the plan, and a camera image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from modular_framework_simulation.viewer.simulation_status import Phase, Status

NO_CAMERA = "none"
AS_FAST_AS_POSSIBLE = "as fast as possible"
_FACTORS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)
_STEPS_S = {"1 step": 0.0, "0.1 s": 0.1, "1 s": 1.0}


class CommandError(Exception):
    """The simulation did not execute a command; the text gives the reason."""


class Commands(Protocol):
    """Commands of the buttons to the simulation; a failed command raises CommandError."""

    def pause(self) -> None:
        """Pauses time."""

    def unpause(self) -> None:
        """Unpauses time."""

    def step(self, duration_s: float) -> None:
        """Pauses time and advances by a duration [s]; 0 for one physics step."""

    def reset_world(self) -> None:
        """Resets the models and the robot to their initial poses."""

    def reset_simulation(self) -> None:
        """Resets the models and the robot to their initial poses, and time to 0."""

    def set_real_time_factor(self, factor: float) -> None:
        """Sets the maximum ratio of simulated to real time; 0 for as fast as possible."""

    def real_time_factor(self) -> float:
        """Returns the maximum ratio of simulated to real time."""


class ControlPanel:
    """Buttons, check boxes and camera image, whose state is read by the drawing thread.

    Args:
        server: The viser server.
        commands: Commands of the buttons.
        log: Function that logs a failed command.
        read_only: Whether commands are refused and their buttons hidden.
    """

    def __init__(self, server: Any, commands: Commands, log: Callable[[str], None], *, read_only: bool = False) -> None:
        self._server, self._commands, self._log, self._read_only = server, commands, log, read_only
        gui = server.gui
        self._status = gui.add_markdown(str(Status(phase=Phase.SEARCHING)))
        self._shown_status = ""
        self._time = gui.add_folder("Time")
        with self._time:
            self._add_time_controls(gui)
        with gui.add_folder("Show"):
            self._world = gui.add_checkbox("World", True)
            self._robot = gui.add_checkbox("Robot", True)
            self._scene = gui.add_checkbox("Planning scene", False, hint="Objects in move_group's planning scene")
            self._plan = gui.add_checkbox("Plan", True)
            self._grid = gui.add_checkbox("Grid", False)
            self._shadows = gui.add_checkbox("Shadows", True)
        with gui.add_folder("Plan"):
            self._replay = gui.add_button("Replay", hint="Shows the latest planned motion")
            self._loop = gui.add_checkbox("Repeat", False)
            self._position = gui.add_slider("Position", 0.0, 1.0, 0.005, 0.0)
        with gui.add_folder("Camera"):
            self._camera = gui.add_dropdown("Image", (NO_CAMERA,), initial_value=NO_CAMERA)
            self._image = gui.add_image(np.zeros((3, 4, 3), np.uint8), format="jpeg", visible=False)

    def _add_time_controls(self, gui: Any) -> None:
        self._paused = gui.add_button("Pause")
        self._resumed = gui.add_button("Resume", visible=False)
        self._step = gui.add_button_group("Step", tuple(_STEPS_S))
        self._speed = gui.add_dropdown(
            "Speed", _speeds(1.0), initial_value=_speed_text(1.0), hint="Maximum real time factor"
        )
        self._known_speed = self._speed.value
        reset = gui.add_button("Reset poses", hint="/gazebo/reset_world: time continues")
        reset_all = gui.add_button("Reset poses and time", hint="/gazebo/reset_simulation")
        commands = self._commands
        self._paused.on_click(lambda event: self._do(event, commands.pause))
        self._resumed.on_click(lambda event: self._do(event, commands.unpause))
        self._step.on_click(lambda event: self._do(event, lambda: commands.step(_STEPS_S[self._step.value])))
        self._speed.on_update(self._on_speed)
        reset.on_click(lambda event: self._do(event, commands.reset_world))
        reset_all.on_click(lambda event: self._do(event, commands.reset_simulation))

    def _do(self, event: Any, command: Callable[[], None]) -> None:
        try:
            if self._read_only:
                raise CommandError("the viewer is read-only; start it with read_only:=false")
            command()
        except CommandError as error:
            self._log(str(error))
            if event.client is not None:
                event.client.add_notification("Command failed", str(error), auto_close_seconds=10.0)

    def _on_speed(self, event: Any) -> None:
        if self._speed.value != self._known_speed:
            self._known_speed = self._speed.value
            text = self._speed.value
            factor = 0.0 if text == AS_FAST_AS_POSSIBLE else float(text)
            self._do(event, lambda: self._commands.set_real_time_factor(factor))

    def refresh_speed(self) -> None:
        """Shows the simulation's maximum ratio of simulated to real time; does nothing without a simulation."""
        try:
            factor = self._commands.real_time_factor()
        except CommandError:
            return
        self._known_speed = _speed_text(factor)
        self._speed.options = _speeds(factor)
        self._speed.value = self._known_speed

    def show_status(self, status: Status, activity: str = "") -> None:
        """Shows the status of the simulation.

        Args:
            status: Status of the simulation.
            activity: Activity of the viewer; empty for none.
        """
        text = f"{status} {activity}".rstrip()
        if text == self._shown_status:
            return
        self._shown_status = text
        self._status.content = text
        for handle, visible in (
            (self._time, status.has_controls and not self._read_only),
            (self._paused, not status.paused),
            (self._resumed, status.paused),
        ):
            if handle.visible != visible:
                handle.visible = visible

    def shows(self, layer: str) -> bool:
        """Returns whether a layer is visible.

        Args:
            layer: "world", "robot", "planning scene", "plan", "grid" or "shadows".
        """
        boxes = {
            "world": self._world,
            "robot": self._robot,
            "planning scene": self._scene,
            "plan": self._plan,
            "grid": self._grid,
            "shadows": self._shadows,
        }
        return bool(boxes[layer].value)

    def show_planning_scene(self) -> None:
        """Shows the layer of the planning scene."""
        self._scene.value = True

    def on_replay(self, action: Callable[[], None]) -> None:
        """Sets an action for the replay button."""
        self._replay.on_click(lambda _event: action())

    def on_position(self, action: Callable[[float], None]) -> None:
        """Sets an action for the position slider, which is called with the fraction of the motion."""
        self._position.on_update(lambda event: action(self._position.value) if event.client is not None else None)

    @property
    def repeats(self) -> bool:
        """Returns whether a replay repeats."""
        return bool(self._loop.value)

    @property
    def camera(self) -> str:
        """Returns the topic of the displayed image; empty for none."""
        return "" if self._camera.value == NO_CAMERA else str(self._camera.value)

    def offer_cameras(self, topics: Sequence[str]) -> None:
        """Sets the selectable image topics; the selected topic remains selectable."""
        options = (NO_CAMERA, *sorted({*topics, *([self.camera] if self.camera else [])}))
        if tuple(self._camera.options) != options:
            chosen = self._camera.value
            self._camera.options = options
            self._camera.value = chosen

    def show_image(self, picture: NDArray[np.uint8] | None) -> None:
        """Shows an image, shape (height, width, 3), or hides the image for None."""
        if picture is not None:
            self._image.image = picture
        if self._image.visible != (picture is not None):
            self._image.visible = picture is not None


def _speed_text(factor: float) -> str:
    return f"{factor:g}" if factor else AS_FAST_AS_POSSIBLE


def _speeds(current: float) -> tuple[str, ...]:
    """Returns the selectable speeds, including the current speed."""
    return (*(_speed_text(factor) for factor in sorted({*_FACTORS, current} - {0.0})), AS_FAST_AS_POSSIBLE)
