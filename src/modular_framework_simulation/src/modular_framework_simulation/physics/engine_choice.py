# SPDX-License-Identifier: BSD-3-Clause
"""Physics engines by name; an engine is only imported if selected."""

from __future__ import annotations

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.physics.physics_engine import Log, PhysicsEngine
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_urdf.rotations import Vector3

PYBULLET = "pybullet"
MUJOCO = "mujoco"
ENGINES = (PYBULLET, MUJOCO)
"""Names of the engines, starting with the default."""


def make_engine(name: str, settings: PhysicsSettings, gravity: Vector3, gui: bool, log: Log) -> PhysicsEngine:
    """Creates an empty engine.

    Args:
        name: Name in `ENGINES`.
        settings: Settings of the physics engine.
        gravity: Gravity vector in the world frame [m/s^2].
        gui: Whether to open a window; a missing window or display is logged.
        log: Function that logs a decision.

    Raises:
        SimulationError: The engine is unknown or not installed.
    """
    match name:
        case "pybullet":
            from modular_framework_simulation.physics.pybullet_engine import PyBulletEngine

            return PyBulletEngine(settings, gravity, gui, log)
        case "mujoco":
            try:
                from modular_framework_simulation.physics.mujoco_engine import MujocoEngine
            except ModuleNotFoundError as error:
                raise SimulationError(
                    f"physics engine 'mujoco': {error}; install the package mujoco of requirements.txt, or select "
                    "'pybullet'"
                ) from error
            return MujocoEngine(settings, gravity, gui, log)
    raise SimulationError(f"physics engine '{name}' is unknown; allowed: {', '.join(ENGINES)}")
