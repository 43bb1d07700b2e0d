# SPDX-License-Identifier: BSD-3-Clause
"""Emulates a Universal Robots controller for its clients, with injected faults.

The emulator has the ports of a controller: RTDE (30004), scripts (30001, 30002, 30003), dashboard (29999). The effect
of the program that ur-rtde uploads is emulated (ur_control_script.py). The arm is a UR5. The command port
(command_port.py) injects faults and logs commanded positions. Its commands are the methods `inject_<name>` and
`command_<name>`; the command `help` lists all commands.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import IO

from modular_framework_control.realtime.scheduling import run_in_real_time
from modular_framework_testing.emulators.command_port import CommandPort
from modular_framework_testing.emulators.ur_control_script import ProgramReceiver
from modular_framework_testing.emulators.ur_controller import HOME, MODELS, UrController
from modular_framework_testing.emulators.ur_dashboard import BANNER, DashboardReceiver
from modular_framework_testing.emulators.ur_motion import JOINTS
from modular_framework_testing.emulators.ur_network import NetworkFaults, PortServer, Session
from modular_framework_testing.emulators.ur_rtde_server import REFUSALS, RtdeServer, RtdeSession

LOGGER = logging.getLogger("rosout.ur_emulator")
RTDE_PORT, SCRIPT_PORTS, DASHBOARD_PORT, COMMAND_PORT = 30004, (30001, 30002, 30003), 29999, 29901
_PRIORITY, _OTHERS_PRIORITY = 65, 55  # below the control loop, above the driver, which may wait in a busy loop
_MAX_MISSED_CYCLES = 25  # cycles; after a longer delay, the controller skips the missed cycles


class UrEmulator:
    """Emulates a controller with its ports, and injects faults.

    Args:
        address: IP address of the ports.
        model: Name of a model in MODELS.
        positions: Initial joint positions [rad], shape (6,).
        unlock_delay_s: Time between a protective stop and its earliest release [s].
        command_port: TCP port of the commands; 0 for any free port.

    Raises:
        ValueError: The model is unknown, or the number of positions is wrong.
    """

    def __init__(
        self,
        address: str = "127.0.0.1",
        model: str = "UR5",
        positions: Sequence[float] = HOME,
        unlock_delay_s: float = 5.0,
        command_port: int = COMMAND_PORT,
    ) -> None:
        if model not in MODELS or len(positions) != JOINTS:
            raise ValueError(
                f"emulator of a UR arm: got model {model!r} and {len(positions)} joint positions; "
                f"expected one of {', '.join(MODELS)} and {JOINTS} positions"
            )
        self.controller = UrController(MODELS[model], positions, unlock_delay_s)
        self._rtde = RtdeServer(self.controller)
        ports: dict[int, Callable[[], Session]] = {RTDE_PORT: self._rtde_session, DASHBOARD_PORT: self._dashboard}
        ports.update({port: self._script_session for port in SCRIPT_PORTS})
        self._ports = PortServer(address, ports)
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._log: IO[str] | None = None
        self.commands: dict[str, Callable[..., str | None]] = {
            name.partition("_")[2]: self._with_lock(getattr(self, name))
            for name in dir(self)
            if name.startswith(("inject_", "command_"))
        }
        self._command_port = CommandPort(self.commands, command_port, address)

    def connect(self) -> None:
        """Opens the ports.

        Raises:
            OSError: A port is in use; the text names the port.
        """
        self._ports.connect()
        self._command_port.connect()

    def run(self) -> None:
        """Serves until `stop`, with real-time priority if permitted."""
        run_in_real_time(_PRIORITY, _OTHERS_PRIORITY)
        period_s = self.controller.period_s
        next_s = time.monotonic() + period_s
        while not self._stopping.is_set():
            ready = self._ports.wait(min(next_s - time.monotonic(), 0.1))
            with self._lock:
                now_s = time.monotonic()
                self._ports.serve(ready, now_s)
                if now_s >= next_s:
                    self.controller.cycle()
                    self._ports.cycle(now_s)
                    next_s += period_s
                    if now_s - next_s > _MAX_MISSED_CYCLES * period_s:
                        next_s = now_s + period_s
            if ready and self._ports.faults.frozen:  # avoids a busy loop, because the received data stays unread
                time.sleep(max(0.0, next_s - time.monotonic()))

    def stop(self) -> None:
        """Ends `run`."""
        self._stopping.set()

    def close(self) -> None:
        """Closes all ports and the log; may be called twice."""
        self._command_port.close()
        with self._lock:
            self._ports.close()
            self._close_log()

    def _with_lock(self, command: Callable[..., str | None]) -> Callable[..., str | None]:
        def run(*arguments: object, **keywords: object) -> str | None:
            with self._lock:
                return command(*arguments, **keywords)

        run.__doc__ = command.__doc__
        run.__wrapped__ = command  # type: ignore[attr-defined]
        return run

    def _rtde_session(self) -> Session:
        session = RtdeSession(self._rtde)
        return Session(session.receive, session.cycle, session.close)

    def _script_session(self) -> Session:
        receiver = ProgramReceiver(self.controller)

        def receive(data: bytes) -> bytes:
            receiver.receive(data)
            return b""

        return Session(receive)

    def _dashboard(self) -> Session:
        return Session(DashboardReceiver(self.controller).receive, greeting=BANNER.encode())

    def inject_cut(self) -> None:
        """Close all connections and refuse new connections, until `restore`."""
        self._ports.close()

    def inject_freeze(self) -> None:
        """Transmit no data while connections stay open (half-open sockets), until `restore`."""
        self._ports.faults.frozen = True

    def inject_delay(self, seconds: float) -> None:
        """Delay all sent data by `seconds` [s]."""
        if seconds < 0.0:
            raise ValueError(f"seconds={seconds}: expected a number of at least 0")
        self._ports.faults.delay_s = float(seconds)

    def inject_lose(self, every: int) -> None:
        """Lose every n-th data package, with n = `every`; 0 for no losses."""
        if every < 0:
            raise ValueError(f"every={every}: expected a whole number of at least 0")
        self._ports.faults.lose_every = int(every)

    def inject_corrupt(self, every: int) -> None:
        """Flip bits in every n-th data package, with n = `every`; 0 for no flipped bits."""
        if every < 0:
            raise ValueError(f"every={every}: expected a whole number of at least 0")
        self._ports.faults.corrupt_every = int(every)

    def inject_refuse(self, what: str) -> None:
        """Refuse the `protocol` of clients, or report an old software `version`, until `restore`."""
        if what not in REFUSALS:
            raise ValueError(f"what={what}: expected one of {', '.join(filter(None, REFUSALS))}")
        self._rtde.refusal = what

    def inject_garbage(self, count: int = 64) -> None:
        """Send `count` random bytes between data packages."""
        self._ports.send_to_all(os.urandom(int(count)), time.monotonic())

    def command_restore(self) -> None:
        """End all faults of the network."""
        self._ports.faults = NetworkFaults()
        self._rtde.refusal = ""
        self._ports.connect()

    def inject_protective_stop(self) -> None:
        """Trigger a protective stop, as after a collision."""
        self.controller.protective_stop()

    def command_unlock(self) -> str:
        """Release the protective stop, as on the teach pendant."""
        return "unlocked" if self.controller.unlock() else "too early"

    def inject_emergency_stop(self) -> None:
        """Press the emergency stop button."""
        self.controller.emergency_stop()

    def command_release_emergency_stop(self) -> None:
        """Release the emergency stop button; the arm remains without power and with closed brakes."""
        self.controller.release_emergency_stop()

    def inject_power_off(self) -> None:
        """Cut the power of the arm."""
        self.controller.power_off()

    def command_power_on(self) -> None:
        """Switch the arm on and release the brakes."""
        self.controller.brake_release()

    def command_slider(self, value: float) -> None:
        """Set the speed slider, from 0 to 1."""
        if not 0.0 <= value <= 1.0:
            raise ValueError(f"value={value}: expected a number from 0 to 1")
        self.controller.speed_slider = float(value)

    def command_pause(self) -> str:
        """Pause the program."""
        return "paused" if self.controller.pause() else "nothing plays"

    def command_play(self) -> str:
        """Resume the paused program."""
        return "plays" if self.controller.play() else "nothing is paused"

    def command_stop_program(self) -> None:
        """Stop the program, as on the teach pendant."""
        self.controller.stop_program()

    def command_wrench(
        self, *, fx: float = 0.0, fy: float = 0.0, fz: float = 0.0, tx: float = 0.0, ty: float = 0.0, tz: float = 0.0
    ) -> None:
        """Set the measured wrench.

        Args:
            fx: Force along x [N].
            fy: Force along y [N].
            fz: Force along z [N].
            tx: Torque about x [Nm].
            ty: Torque about y [Nm].
            tz: Torque about z [Nm].
        """
        self.controller.wrench = (float(fx), float(fy), float(fz), float(tx), float(ty), float(tz))

    def command_state(self) -> str:
        """Return modes, slider, connections, payload and joint positions."""
        controller = self.controller
        return (
            f"robot_mode={controller.robot_mode.name} safety_mode={controller.safety_mode.name} "
            f"runtime_state={controller.runtime_state.name} slider={controller.speed_slider:g} "
            f"connections={self._ports.connections} payload_kg={controller.payload_kg:g} "
            f"q={','.join(f'{position:.6f}' for position in controller.motion.positions)}"
        )

    def command_log(self, path: str, always: bool = False) -> None:
        """Log commanded and actual positions [rad] to a CSV file, with wall time and controller time [s].

        Args:
            path: Path of the file.
            always: Whether to log every cycle, instead of cycles with streamed positions.
        """
        self._close_log()
        self._log = open(path, "w", encoding="utf-8")  # noqa: SIM115  closed by _end_log
        self._log.write(
            "wall_s,controller_s,"
            + ",".join(f"{kind}_{joint}" for kind in ("command", "actual") for joint in range(JOINTS))
            + "\n"
        )
        self.controller.on_cycle = partial(self._write_log, self._log, always)

    def command_end_log(self) -> None:
        """End the log and close the file."""
        self._close_log()

    def _write_log(self, log: IO[str], always: bool) -> None:
        controller = self.controller
        if always or controller.is_streaming:
            numbers = ",".join(f"{value:.9f}" for value in (*controller.target_positions, *controller.motion.positions))
            log.write(f"{time.time():.6f},{controller.time_s:.6f},{numbers}\n")

    def _close_log(self) -> None:
        self.controller.on_cycle = None
        log, self._log = self._log, None
        if log is not None:
            log.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs an emulator without ROS; returns the exit code."""
    parser = argparse.ArgumentParser(description="Emulates a Universal Robots controller.")
    parser.add_argument("--address", default="127.0.0.1", help="IP address of the ports")
    parser.add_argument("--model", default="UR5", choices=sorted(MODELS))
    parser.add_argument(
        "--unlock-delay", type=float, default=5.0, help="time between a protective stop and its earliest release [s]"
    )
    parser.add_argument("--command-port", type=int, default=COMMAND_PORT)
    parser.add_argument("--positions", type=float, nargs=JOINTS, default=HOME, help="initial joint positions [rad]")
    parser.add_argument("--quiet", action="store_true", help="log warnings and errors only")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.WARNING if options.quiet else logging.INFO)
    emulator = UrEmulator(options.address, options.model, options.positions, options.unlock_delay, options.command_port)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: emulator.stop())
    try:
        emulator.connect()
    except OSError as error:
        LOGGER.error("%s", error)
        return 1
    print("ready", flush=True)
    emulator.run()
    emulator.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
