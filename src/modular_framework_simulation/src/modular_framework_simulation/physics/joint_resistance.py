# SPDX-License-Identifier: BSD-3-Clause
"""Sets damping and friction of joints in the engine as specified in a description."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from modular_framework_simulation.models.sdf_specs import JointDynamics
from modular_framework_simulation.physics.physics_engine import PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody

_MAX_LOSS_FRACTION = 0.5
"""Maximum fraction of velocity that damping removes in one step; the engine's explicit integration then remains stable,
even if a change of the pose reduces the inertia of a joint to a quarter."""


def set_joint_resistance(engine: PhysicsEngine, body: SimulatedBody, dynamics: Mapping[str, JointDynamics]) -> None:
    """Sets damping and friction of all movable joints; joints without an entry have none.

    Args:
        engine: The physics engine.
        body: The body, with its joints at their initial positions.
        dynamics: Dynamics by joint name; the engine has no springs, see `body_forces`.
    """
    described = {name: dynamics[name].damping for name in body.joint_indices if name in dynamics}
    damping = stable_damping(engine, body, described) if any(described.values()) else {}
    for name, index in body.joint_indices.items():
        engine.set_joint_damping(body.number, index, damping.get(name, 0.0))
        # A motor with this maximum effort acts as Coulomb friction; without it, PyBullet's default motor would brake.
        engine.set_velocity_motor(body.number, index, 0.0, dynamics[name].friction if name in dynamics else 0.0)


def stable_damping(engine: PhysicsEngine, body: SimulatedBody, damping: Mapping[str, float]) -> dict[str, float]:
    """Returns damping values for which the engine's explicit steps have the velocities of the continuous motion.

    An explicit step removes the fraction d' h / I of the velocity; the exact fraction is 1 - exp(-d h / I), which
    defines d'. If the damping of all joints together removes more than `_MAX_LOSS_FRACTION`, all values are reduced.

    Args:
        engine: The physics engine.
        body: The body, with its joints at their initial positions.
        damping: Damping values of the description [N m s/rad or N s/m], by joint name.
    """
    step_s = engine.settings.time_step_s
    names = list(body.joint_indices)
    inverse = inverse_mass_matrix(engine, body)
    described = np.array([damping.get(name, 0.0) for name in names])
    mobility = np.diag(inverse) * step_s
    exact = np.array([-math.expm1(-d * m) / m if d * m > 0.0 else d for d, m in zip(described, mobility, strict=True)])
    roots = np.sqrt(exact)
    largest = float(np.linalg.eigvalsh(roots[:, None] * inverse * roots * step_s).max())
    exact *= min(1.0, _MAX_LOSS_FRACTION / largest) if largest > 0.0 else 1.0
    return dict(zip(names, exact.tolist(), strict=True))


def inverse_mass_matrix(engine: PhysicsEngine, body: SimulatedBody) -> npt.NDArray[np.float64]:
    """Returns the joint accelerations per effort [1/(kg m^2) or 1/kg] at the current joint positions, shape (n, n).

    A body with ball joints has zeros, because the engine does not provide its mass matrix; its damping is then used
    as described.
    """
    indices = list(body.joint_indices.values())
    if body.ball_joint_indices:
        return np.zeros((len(indices), len(indices)))
    inverse: npt.NDArray[np.float64] = np.linalg.inv(engine.mass_matrix(body.number, indices)).astype(np.float64)
    return inverse[-len(indices) :, -len(indices) :]
