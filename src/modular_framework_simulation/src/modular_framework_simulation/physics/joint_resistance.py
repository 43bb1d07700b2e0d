# SPDX-License-Identifier: BSD-3-Clause
"""Gives the joints of a body in the engine the damping and the friction of their description."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.models.sdf_specs import JointDynamics
from modular_framework_simulation.physics.physics_engine import PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody

_LARGEST_SHARE = 0.5
"""Of its velocity that a joint may lose in one step: even where the pose of the other joints lets it become four times
easier to move than at the start, the engine's explicit integration is stable."""


def set_joint_resistance(engine: PhysicsEngine, body: SimulatedBody, dynamics: Mapping[str, JointDynamics]) -> None:
    """Sets damping and friction of all movable joints; those that are not named get none.

    Args:
        engine: Where the body is.
        body: Its joints are where they start.
        dynamics: By the name of the joint; springs are not the engine's, see `body_forces`.
    """
    wanted = {name: dynamics[name].damping for name in body.joint_indices if name in dynamics}
    damping = stable_damping(engine, body, wanted) if any(wanted.values()) else {}
    for name, index in body.joint_indices.items():
        engine.set_joint_damping(body.number, index, damping.get(name, 0.0))
        # Coulomb friction is a motor that holds the joint as strongly as that. Without one, PyBullet's own would.
        engine.set_velocity_motor(body.number, index, 0.0, dynamics[name].friction if name in dynamics else 0.0)


def stable_damping(engine: PhysicsEngine, body: SimulatedBody, damping: Mapping[str, float]) -> dict[str, float]:
    """Returns the damping with which the engine's explicit steps end at the velocity of the continuous motion.

    A step takes the share d' h / I of the velocity, and has to take 1 - exp(-d h / I); d' is the damping that does.
    Where many strong ones together would take more than `_LARGEST_SHARE`, all are weakened alike.

    Args:
        engine: Where the body is.
        body: Its joints are where they start.
        damping: As described [N m s/rad or N s/m], by the name of the joint.
    """
    step_s = engine.settings.time_step_s
    names = list(body.joint_indices)
    inverse = inverse_mass_matrix(engine, body)
    wanted = np.array([damping.get(name, 0.0) for name in names])
    mobility = np.diag(inverse) * step_s
    exact = np.array([-math.expm1(-d * m) / m if d * m > 0.0 else d for d, m in zip(wanted, mobility, strict=True)])
    roots = np.sqrt(exact)
    largest = float(np.linalg.eigvalsh(roots[:, None] * inverse * roots * step_s).max())
    exact *= min(1.0, _LARGEST_SHARE / largest) if largest > 0.0 else 1.0
    return dict(zip(names, exact.tolist(), strict=True))


def inverse_mass_matrix(engine: PhysicsEngine, body: SimulatedBody) -> npt.NDArray[np.float64]:
    """Returns how the movable joints answer to forces on them [1/(kg m^2) or 1/kg], where the joints are now.

    Zeros for a body with ball joints, whose mass matrix the engine does not give: what depends on it is as described.
    """
    indices = list(body.joint_indices.values())
    if body.ball_joint_indices:
        return np.zeros((len(indices), len(indices)))
    inverse: npt.NDArray[np.float64] = np.linalg.inv(engine.mass_matrix(body.number, indices)).astype(np.float64)
    return inverse[-len(indices) :, -len(indices) :]
