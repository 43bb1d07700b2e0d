# SPDX-License-Identifier: BSD-3-Clause
"""Emulates the dashboard server with the texts of the real server, because clients compare them."""

from __future__ import annotations

from collections.abc import Callable

from modular_framework_testing.emulators.ur_controller import RobotMode, RuntimeState, SafetyMode, UrController

BANNER = "Connected: Universal Robots Dashboard Server\n"


class DashboardReceiver:
    """Responds to the requests of one client.

    Args:
        controller: Emulated controller.
    """

    def __init__(self, controller: UrController) -> None:
        self._controller = controller
        self._text = ""
        self._answers: dict[str, Callable[[], str]] = {
            "play": self._play,
            "pause": lambda: "Pausing program" if controller.pause() else "Failed to execute: pause",
            "stop": self._stop,
            "running": lambda: f"Program running: {str(controller.runtime_state is RuntimeState.PLAYING).lower()}",
            "programstate": self._program_state,
            "polyscopeversion": self._version,
            "version": self._version,
            "robotmode": lambda: f"Robotmode: {controller.robot_mode.name}",
            "safetymode": lambda: f"Safetymode: {controller.safety_mode.name}",
            "safetystatus": lambda: f"Safetystatus: {controller.safety_mode.name}",
            "unlock protective stop": self._unlock,
            "restart safety": self._restart_safety,
            "power on": lambda: self._done(controller.power_on, "Powering on"),
            "power off": lambda: self._done(controller.power_off, "Powering off"),
            "brake release": lambda: self._done(controller.brake_release, "Brake releasing"),
            "close popup": lambda: "closing popup",
            "close safety popup": lambda: "closing safety popup",
            "is in remote control": lambda: "true",
            "get serial number": lambda: "20150500001",
            "get robot model": lambda: controller.model.name,
            "get loaded program": lambda: "No program loaded",
            "isprogramsaved": lambda: "false",
            "quit": lambda: "Disconnected",
            "shutdown": lambda: self._done(controller.power_off, "Shutting down"),
        }

    def receive(self, data: bytes) -> bytes:
        """Returns the response to received bytes."""
        self._text += data.decode("utf-8", errors="replace")
        *lines, self._text = self._text.split("\n")
        return "".join(self.answer(line.strip()) + "\n" for line in lines).encode()

    def answer(self, line: str) -> str:
        """Returns the response to one line."""
        lowered = line.lower()
        if lowered in self._answers:
            return self._answers[lowered]()
        for beginning, answer in (
            ("popup ", "showing popup"),
            ("addtolog ", "Added log message"),
            ("load ", f"File not found: {line[5:]}"),
            ("setuserrole ", "Setting user role"),
        ):
            if lowered.startswith(beginning):
                return answer
        return f"could not understand: '{line}'"

    def _done(self, action: Callable[[], None], answer: str) -> str:
        action()
        return answer

    def _play(self) -> str:
        return "Starting program" if self._controller.play() else "Failed to execute: play"

    def _stop(self) -> str:
        self._controller.stop_program()
        return "Stopped"

    def _program_state(self) -> str:
        program = self._controller.program
        return f"{self._controller.runtime_state.name} {program.name if program is not None else '<unnamed>'}"

    def _version(self) -> str:
        return "URSoftware " + ".".join(map(str, self._controller.model.version))

    def _unlock(self) -> str:
        if self._controller.unlock():
            return "Protective stop releasing"
        return (
            "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop "
            "before unlocking"
        )

    def _restart_safety(self) -> str:
        if self._controller.safety_mode is SafetyMode.NORMAL and self._controller.robot_mode is RobotMode.RUNNING:
            return "Restarting safety"
        self._controller.power_off()
        return "Restarting safety"
