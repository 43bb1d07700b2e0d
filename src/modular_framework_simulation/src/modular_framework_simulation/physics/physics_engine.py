# SPDX-License-Identifier: BSD-3-Clause
"""One connection to the physics engine, set up the way this package needs it.

Everything here must be called from one thread: the engine keeps global state.
"""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from modular_framework_simulation.errors import DescriptionError, SimulationError
from modular_framework_simulation.physics.contact_rules import let_smaller_coefficient_count
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_urdf import xml_text
from modular_framework_urdf.rotations import Vector3

BASE_INDEX = -1
"""The engine's number of a body's root link."""

LONGEST_NAME_BYTES = 1023
"""The engine copies names and file names into arrays of 1,024 bytes without checking their length, and crashes."""

_SHOWN_CHARACTERS = 40
_NAMING_ATTRIBUTES = ("name", "link", "filename")

Log = Callable[[str], None]


@contextlib.contextmanager
def _silenced() -> Iterator[None]:
    """Keeps the engine's C++ code from writing to the terminal; its problems come back as exceptions."""
    saved = os.dup(1)
    try:
        with open(os.devnull, "w") as nothing:
            os.dup2(nothing.fileno(), 1)
            yield
    finally:
        os.dup2(saved, 1)
        os.close(saved)


def refuse_long_names(text: str, where: str) -> None:
    """Raises DescriptionError where a URDF holds a name, or the name of a file, that the engine has no room for.

    Args:
        text: The URDF.
        where: Named in the error.
    """
    for element in xml_text.parse(text, where).iter():
        for key in _NAMING_ATTRIBUTES:
            value = element.get(key, "")
            size = len(value.encode())
            if size > LONGEST_NAME_BYTES:
                raise DescriptionError(
                    f"{where}: <{element.tag} {key}='{value[:_SHOWN_CHARACTERS]}...'>",
                    f"is {size:,} bytes long",
                    f"the physics engine takes at most {LONGEST_NAME_BYTES:,} bytes; use a shorter name",
                )


class PhysicsEngine:
    """A physics engine with nothing in it.

    Args:
        settings: Numbers of the engine.
        gravity: [m/s^2]
        gui: Whether to open a window; without a display there is none, and a log line says so.
        log: Takes a line of text about what was decided.
    """

    def __init__(self, settings: PhysicsSettings, gravity: Vector3, gui: bool, log: Log) -> None:
        with _silenced():
            import pybullet  # prints its build date when loaded

        self.api: Any = pybullet
        self.settings = settings
        self.client = -1
        self.has_window = False
        if gui:
            self._open_window(log)
        if self.client < 0:
            self.client = self.api.connect(self.api.DIRECT)
        if self.client < 0:
            raise SimulationError("the physics engine accepts no further connection; end another simulation first")
        self._smaller_counts = let_smaller_coefficient_count(self.api)
        if not self._smaller_counts:
            log(
                "this build of the physics engine multiplies coefficients of friction and bounce: between two "
                "different surfaces their geometric mean counts, not the smaller one"
            )
        self._urdf_folder = tempfile.TemporaryDirectory(prefix="simulation_")
        self._files_written = 0
        self._configure(gravity)

    def _open_window(self, log: Log) -> None:
        if not os.environ.get("DISPLAY"):
            log("a window of the simulation was asked for, but there is no display: running headless")
            return
        try:
            self.client = self.api.connect(self.api.GUI)
        except self.api.error as error:
            log(f"no window of the simulation could be opened ({error}): running headless")
        self.has_window = self.client >= 0

    def _set_parameters(self, gravity: Vector3) -> None:
        settings = self.settings
        self.api.setGravity(*gravity, physicsClientId=self.client)
        self.api.setPhysicsEngineParameter(
            fixedTimeStep=settings.time_step_s,
            numSolverIterations=settings.solver_iterations,
            numSubSteps=0,
            contactERP=settings.contact_erp,
            frictionERP=settings.friction_erp,
            contactBreakingThreshold=settings.contact_reach,
            restitutionVelocityThreshold=settings.bounce_threshold,
            enableConeFriction=1,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )

    def _configure(self, gravity: Vector3) -> None:
        self._set_parameters(gravity)
        if self.has_window:
            # Side panels and shadows cost more than the physics where the graphics are drawn by software.
            self.api.configureDebugVisualizer(self.api.COV_ENABLE_GUI, 0, physicsClientId=self.client)
            self.api.configureDebugVisualizer(self.api.COV_ENABLE_SHADOWS, 0, physicsClientId=self.client)
            distance_m, yaw_deg, pitch_deg, target = 1.8, 50.0, -30.0, (0.0, 0.4, 0.9)
            self.api.resetDebugVisualizerCamera(distance_m, yaw_deg, pitch_deg, target, physicsClientId=self.client)

    def adjust(self, settings: PhysicsSettings, gravity: Vector3) -> None:
        """Continues with other settings.

        Args:
            settings: Numbers of the engine.
            gravity: [m/s^2]
        """
        self.settings = settings
        self._set_parameters(gravity)

    def engine_coefficient(self, coefficient: float) -> float:
        """Returns what to give a surface of the engine for a coefficient of friction or restitution."""
        return coefficient if self._smaller_counts else math.sqrt(coefficient)

    def restart(self, gravity: Vector3) -> None:
        """Takes everything out, contacts and their caches too.

        Args:
            gravity: [m/s^2]
        """
        self.api.resetSimulation(physicsClientId=self.client)
        self._configure(gravity)

    def load_urdf(self, text: str, name: str, fixed: bool, flags: int = 0) -> int:
        """Loads a body at the world origin.

        Args:
            text: URDF with absolute mesh paths.
            name: Named in the error.
            fixed: Whether its root link is fastened to the world.
            flags: Further URDF_ flags of the engine.

        Returns:
            The engine's number of the body.

        Raises:
            DescriptionError: The engine refuses the description, or has no room for a name in it.
        """
        refuse_long_names(text, f"model '{name[:_SHOWN_CHARACTERS]}'")
        # The engine remembers files by name, so each body needs a file of its own.
        self._files_written += 1
        file = Path(self._urdf_folder.name) / f"body_{self._files_written}.urdf"
        file.write_text(text, encoding="utf-8")
        try:
            with _silenced():
                body: int = self.api.loadURDF(
                    str(file),
                    useFixedBase=fixed,
                    # With their faces known, boxes and hulls touch in up to four points at once, not in one.
                    flags=flags | self.api.URDF_USE_INERTIA_FROM_FILE | self.api.URDF_INITIALIZE_SAT_FEATURES,
                    physicsClientId=self.client,
                )
            file.unlink()
        except self.api.error as error:
            problem = f"is refused by the physics engine ({error})"
            raise DescriptionError(f"model '{name}'", problem, "check its shapes and joints") from error
        return body

    def joint_infos(self, body: int) -> list[tuple[Any, ...]]:
        """Returns the engine's record of every joint of a body, in the order of the link numbers."""
        count = self.api.getNumJoints(body, physicsClientId=self.client)
        return [self.api.getJointInfo(body, index, physicsClientId=self.client) for index in range(count)]

    def step(self) -> None:
        """Advances the physics by one time step."""
        self.api.stepSimulation(physicsClientId=self.client)

    def close(self) -> None:
        """Ends the connection; may be called twice."""
        if self.client >= 0:
            with contextlib.suppress(self.api.error):
                self.api.disconnect(physicsClientId=self.client)
            self.client = -1
            self._urdf_folder.cleanup()
