# SPDX-License-Identifier: BSD-3-Clause
"""Determines friction, bounce and softness of a link.

Engines have one surface per link. If the shapes of a link differ, the lowest friction and the lowest restitution are
used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.physics.physics_engine import Surface
from modular_framework_simulation.physics.physics_settings import PhysicsSettings

_GAZEBO_KP, _GAZEBO_KD = 1e12, 1.0
"""Gazebo's default stiffness and damping of contacts [N/m, N s/m], which are practically rigid."""


def surface_of(collisions: Sequence[specs.Collision], settings: PhysicsSettings) -> Surface:
    """Returns the surface that represents all shapes of a link."""
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


def softness_of(surface: Surface, settings: PhysicsSettings) -> tuple[float, float] | None:
    """Returns stiffness [N/m] and damping [N s/m] of a contact, or None for a rigid contact.

    A step h corrects the fraction k h / (k h + d) of a penetration, with the compliance 1 / (k h + d). The damping is
    raised if more than `hardest_erp` would be corrected; the penetration at rest, weight / k, does not change.
    """
    kp = _GAZEBO_KP if surface.kp is None else surface.kp
    kd = _GAZEBO_KD if surface.kd is None else surface.kd
    if kp >= _GAZEBO_KP or not math.isfinite(kp) or kp <= 0.0:
        return None
    erp = settings.hardest_erp
    return kp, max(kd, kp * settings.time_step_s * (1.0 - erp) / erp)
