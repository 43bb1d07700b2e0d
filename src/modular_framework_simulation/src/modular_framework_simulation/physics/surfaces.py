# SPDX-License-Identifier: BSD-3-Clause
"""Gives the links of a model in the engine the friction, bounce and softness of its description.

The engine has one surface a link: where the shapes of a link differ, the most slippery and the least bouncy decides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.physics.physics_engine import BASE_INDEX, PhysicsEngine
from modular_framework_simulation.physics.physics_settings import PhysicsSettings

_GAZEBO_KP, _GAZEBO_KD = 1e12, 1.0
"""Gazebo's stiffness and damping of contacts where a model does not say [N/m, N s/m]: as good as rigid."""

_RIGID_DAMPING = 1e9
"""Damping of a contact [N s/m] that does not give way, with which only the share of correction is chosen."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Coefficients of a link; see `specs.Friction`, `specs.Bounce` and `specs.SurfaceContact`."""

    lateral: float
    spinning: float
    rolling: float
    restitution: float = 0.0
    kp: float | None = None
    kd: float | None = None


def surface_of(collisions: Sequence[specs.Collision], settings: PhysicsSettings) -> Surface:
    """Returns the one surface that stands for all shapes of a link."""
    frictions = [each.friction for each in collisions]
    contacts = [each.contact for each in collisions]
    return Surface(
        min(each.lateral if each.mu2 is None else min(each.lateral, each.mu2) for each in frictions),
        min(
            (each.torsional for each in frictions if each.torsional is not None),
            default=settings.body_spinning_friction,
        ),
        min((each.rolling for each in frictions if each.rolling is not None), default=settings.body_rolling_friction),
        min(each.bounce.restitution_coefficient for each in collisions),
        min((each.kp for each in contacts if each.kp is not None), default=None),
        max((each.kd for each in contacts if each.kd is not None), default=None),
    )


def set_surface(engine: PhysicsEngine, number: int, index: int, surface: Surface, anchored: bool = False) -> None:
    """Sets the surface of a link, and takes away the damping that the engine gives every body.

    Args:
        engine: Where the body is.
        number: The engine's number of the body.
        index: Of the link.
        surface: Its coefficients.
        anchored: Whether touches remember where they began, see `PhysicsSettings.friction_erp`.
    """
    further: dict[str, float] = {}
    softness = _softness(engine, surface)
    if softness is not None:
        further["contactStiffness"], further["contactDamping"] = softness
    if surface.restitution > 0.0:
        # The engine slows a body down just before it touches: an impact would begin with another velocity.
        further["contactProcessingThreshold"] = 0.0
    engine.api.changeDynamics(
        number,
        index,
        lateralFriction=engine.engine_coefficient(surface.lateral),
        spinningFriction=surface.spinning,
        rollingFriction=surface.rolling,
        restitution=engine.engine_coefficient(surface.restitution),
        frictionAnchor=int(anchored),
        **further,
        physicsClientId=engine.client,
    )


def take_damping_away(engine: PhysicsEngine, number: int) -> None:
    """Lets a body spin and fly freely: the engine brakes every body by 4 % of its velocity a second."""
    engine.api.changeDynamics(number, BASE_INDEX, linearDamping=0.0, angularDamping=0.0, physicsClientId=engine.client)


def _softness(engine: PhysicsEngine, surface: Surface) -> tuple[float, float] | None:
    """Returns stiffness [N/m] and damping [N s/m] of a contact, or None for the engine's own.

    Of a penetration the share k h / (k h + d) is corrected in a step h, and it gives way by 1 / (k h + d). The damping
    is raised where more than `hardest_erp` would be corrected; the penetration at rest, weight / k, stays the same.
    """
    settings, step_s = engine.settings, engine.settings.time_step_s
    if surface.restitution > 0.0:
        erp = settings.bounce_erp
        return erp / (1.0 - erp) * _RIGID_DAMPING / step_s, _RIGID_DAMPING
    kp = _GAZEBO_KP if surface.kp is None else surface.kp
    kd = _GAZEBO_KD if surface.kd is None else surface.kd
    if kp >= _GAZEBO_KP or not math.isfinite(kp) or kp <= 0.0:
        return None
    erp = settings.hardest_erp
    return kp, max(kd, kp * step_s * (1.0 - erp) / erp)
