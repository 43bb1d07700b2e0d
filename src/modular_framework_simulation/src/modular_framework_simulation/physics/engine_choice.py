# SPDX-License-Identifier: BSD-3-Clause
"""The physics engines there are, by name; each is imported when it is chosen."""

from __future__ import annotations

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.physics.physics_engine import Log, PhysicsEngine
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_urdf.rotations import Vector3

PYBULLET = "pybullet"
MUJOCO = "mujoco"
ENGINES = (PYBULLET, MUJOCO)
"""Names of the engines, the default first."""


def make_engine(name: str, settings: PhysicsSettings, gravity: Vector3, gui: bool, log: Log) -> PhysicsEngine:
    """Returns an engine with nothing in it.

    Args:
        name: One of `ENGINES`.
        settings: Its numbers.
        gravity: [m/s^2]
        gui: Whether to open a window, if the engine has one and there is a display; a log line says if not.
        log: Takes lines of text about what was decided.

    Raises:
        SimulationError: There is no such engine, or it is not installed.
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
                    f"physics engine 'mujoco': {error}; install the package mujoco of requirements.txt, or choose "
                    "'pybullet'"
                ) from error
            return MujocoEngine(settings, gravity, gui, log)
    raise SimulationError(f"physics engine '{name}': there is no such engine; allowed: {', '.join(ENGINES)}")
