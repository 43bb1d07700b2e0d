# SPDX-License-Identifier: BSD-3-Clause
"""Physics settings that can be changed at run time, with the names of Gazebo's parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

from gazebo_msgs.msg import ODEPhysics
from geometry_msgs.msg import Vector3

from modular_framework_ros.reconfiguration import Adjustable
from modular_framework_simulation.loop.simulation_loop import SimulationLoop
from modular_framework_simulation.physics.physics_settings import MAX_STEP_NS, MIN_STEP_NS

_MAX_GRAVITY = 100.0
_MAX_RATE_HZ = 1e6


@dataclass(frozen=True, slots=True)
class PhysicsValues:
    """Physics settings, named as in Gazebo.

    The physics engine does not support the settings that have a default below; they read as 0 and have no effect.

    Attributes:
        time_step: Duration of a physics step [s].
        max_update_rate: Physics steps per second of real time [Hz]; 0 for no limit.
        gravity_x: Gravity along x [m/s^2].
        gravity_y: Gravity along y [m/s^2].
        gravity_z: Gravity along z [m/s^2].
        sor_pgs_iters: Iterations of the contact solver.
        erp: Fraction of a penetration that is corrected in one step.
    """

    time_step: float
    max_update_rate: float
    gravity_x: float
    gravity_y: float
    gravity_z: float
    sor_pgs_iters: int
    erp: float
    auto_disable_bodies: bool = False
    sor_pgs_precon_iters: int = 0
    sor_pgs_w: float = 0.0
    sor_pgs_rms_error_tol: float = 0.0
    cfm: float = 0.0
    contact_surface_layer: float = 0.0
    contact_max_correcting_vel: float = 0.0
    max_contacts: int = 0


_UNSUPPORTED = "only for ODE; the value has no effect in this engine and cannot be changed"

TABLE = (
    Adjustable("time_step", MIN_STEP_NS * 1e-9, MAX_STEP_NS * 1e-9, "duration of a physics step [s]"),
    Adjustable("max_update_rate", 0.0, _MAX_RATE_HZ, "physics steps per second of real time [Hz]; 0: no limit"),
    Adjustable("gravity_x", -_MAX_GRAVITY, _MAX_GRAVITY, "gravity along x [m/s^2]"),
    Adjustable("gravity_y", -_MAX_GRAVITY, _MAX_GRAVITY, "gravity along y [m/s^2]"),
    Adjustable("gravity_z", -_MAX_GRAVITY, _MAX_GRAVITY, "gravity along z [m/s^2]"),
    Adjustable("auto_disable_bodies", False, False, _UNSUPPORTED),
    Adjustable("sor_pgs_precon_iters", 0, 0, _UNSUPPORTED),
    Adjustable("sor_pgs_iters", 1, 10000, "iterations of the contact solver"),
    Adjustable("sor_pgs_w", 0.0, 0.0, _UNSUPPORTED),
    Adjustable("sor_pgs_rms_error_tol", 0.0, 0.0, _UNSUPPORTED),
    Adjustable("cfm", 0.0, 0.0, _UNSUPPORTED),
    Adjustable("erp", 0.0, 1.0, "fraction of a penetration that is corrected in one step"),
    Adjustable("contact_surface_layer", 0.0, 0.0, _UNSUPPORTED),
    Adjustable("contact_max_correcting_vel", 0.0, 0.0, _UNSUPPORTED),
    Adjustable("max_contacts", 0, 0, _UNSUPPORTED),
)
"""Parameters of dynamic_reconfigure, in Gazebo's order."""


class AdjustablePhysics:
    """Reads and changes the settings; only used by the loop's thread.

    Args:
        loop: Loop with the world and the pacer.
    """

    def __init__(self, loop: SimulationLoop) -> None:
        self._loop = loop

    def current(self) -> PhysicsValues:
        """Returns the current settings."""
        settings, factor = self._loop.world.settings, self._loop.pacer.real_time_factor
        x, y, z = self._loop.world.gravity
        return PhysicsValues(
            time_step=settings.time_step_s,
            max_update_rate=factor / settings.time_step_s,
            gravity_x=x,
            gravity_y=y,
            gravity_z=z,
            sor_pgs_iters=settings.solver_iterations,
            erp=settings.contact_erp,
        )

    def apply(self, values: PhysicsValues) -> list[str]:
        """Applies settings.

        Returns:
            Names of the unsupported settings in the request, which are ignored.

        Raises:
            ValueError: A value is out of range; no setting has changed.
        """
        faults = [text for item in TABLE if (text := _fault(item, getattr(values, item.name)))]
        if faults:
            raise ValueError("; ".join(faults))
        current = self.current()
        world = self._loop.world
        settings = replace(
            world.settings,
            time_step_ns=round(values.time_step * 1e9),
            solver_iterations=values.sor_pgs_iters,
            contact_erp=values.erp,
        )
        gravity = (values.gravity_x, values.gravity_y, values.gravity_z)
        if (settings, gravity) != (world.settings, world.gravity):
            world.set_physics(settings, gravity)
        if (values.time_step, values.max_update_rate) != (current.time_step, current.max_update_rate):
            self._loop.pacer.set_factor(values.max_update_rate * settings.time_step_s)
        return [item.name for item in TABLE if _is_fixed(item) and getattr(values, item.name) != item.lowest]


def values_from_request(request: Any) -> PhysicsValues:
    """Returns the settings in a SetPhysicsProperties request."""
    ode = request.ode_config
    shared = {field.name: getattr(ode, field.name) for field in fields(PhysicsValues) if hasattr(ode, field.name)}
    gravity = request.gravity
    return PhysicsValues(
        time_step=request.time_step,
        max_update_rate=request.max_update_rate,
        gravity_x=gravity.x,
        gravity_y=gravity.y,
        gravity_z=gravity.z,
        **shared,
    )


def gravity_to_msg(values: PhysicsValues) -> Vector3:
    """Returns gravity as a geometry_msgs/Vector3."""
    return Vector3(values.gravity_x, values.gravity_y, values.gravity_z)


def ode_to_msg(values: PhysicsValues) -> ODEPhysics:
    """Returns the solver settings as gazebo_msgs/ODEPhysics."""
    return ODEPhysics(**{name: getattr(values, name) for name in ODEPhysics.__slots__})


def _is_fixed(item: Adjustable) -> bool:
    return item.lowest == item.highest


def _fault(item: Adjustable, value: float) -> str:
    if not math.isfinite(value):
        return f"{item.name} is {value}; allowed: finite numbers"
    if not _is_fixed(item) and not item.lowest <= value <= item.highest:
        return f"{item.name} is {value:g}; allowed: {item.lowest:g} to {item.highest:g}"
    return ""
