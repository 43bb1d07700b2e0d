# SPDX-License-Identifier: BSD-3-Clause
"""Forces on models without a corresponding setting in the engine: joint springs, drag, and disabled gravity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.physics.joint_resistance import inverse_mass_matrix
from modular_framework_simulation.physics.physics_engine import BASE_INDEX, PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody
from modular_framework_urdf.rotations import Quaternion, Vector3

_DECAY_STEP_S = 1e-3
"""Default step of Gazebo [s]; a velocity decay applies once per step."""


class BodyForce(Protocol):
    """Force that is applied before every step."""

    def apply(self, gravity: Vector3) -> None:
        """Applies the force for one step.

        Args:
            gravity: Gravity vector in the world frame [m/s^2].
        """


def forces_of(engine: PhysicsEngine, body: SimulatedBody, model: specs.Model) -> tuple[BodyForce, ...]:
    """Returns the forces on a tree of a model; empty for most models.

    Args:
        engine: The physics engine.
        body: The tree, with its joints at their initial positions.
        model: Description of the model.
    """
    if model.static:
        return ()
    forces: list[BodyForce] = []
    springs = [
        joint for joint in model.joints if joint.name in body.joint_indices and joint.dynamics.spring_stiffness > 0.0
    ]
    if springs:
        mobility = dict(zip(body.joint_indices, np.diag(inverse_mass_matrix(engine, body)).tolist(), strict=True))
        forces += [_Spring(engine, body, joint.name, joint.dynamics, mobility[joint.name]) for joint in springs]
    for link in model.links:
        index = body.link_indices.get(link.name)
        if index is not None and link.velocity_decay != specs.VelocityDecay():
            forces.append(_Drag(engine, body, index, link.velocity_decay))
        if index is not None and not link.gravity:
            forces.append(_Buoyancy(engine, body, index))
    return tuple(forces)


@dataclass(frozen=True, slots=True)
class _Spring:
    """Spring of a joint; `mobility` is the joint acceleration per effort [1/(kg m^2) or 1/kg]."""

    engine: PhysicsEngine
    body: SimulatedBody
    joint: str
    dynamics: specs.JointDynamics
    mobility: float

    def apply(self, gravity: Vector3) -> None:
        """Applies the effort of the spring."""
        del gravity
        step_s, index = self.engine.settings.time_step_s, self.body.joint_indices[self.joint]
        ((position, velocity, _),) = self.engine.joint_states(self.body.number, [index])
        deflection, stiffness = position - self.dynamics.spring_reference, self.dynamics.spring_stiffness
        # The force at the start of the step conserves the energy of an oscillation. For a spring that is too stiff,
        # with a period close to the time step, the force at the end of the step is used.
        stiffness_ratio = stiffness * step_s * step_s * self.mobility
        force = -stiffness * (
            deflection if stiffness_ratio < 1.0 else (deflection + step_s * velocity) / (1.0 + stiffness_ratio)
        )
        self.engine.apply_effort(self.body.number, index, force)


class _CentreMotion(NamedTuple):
    """Position, axes (columns), velocity and angular velocity of a centre of mass, in the world frame."""

    position: Vector3
    axes: np.ndarray
    linear: np.ndarray
    angular: np.ndarray


class _LinkForce:
    """Mass and motion of the link that a force acts on."""

    def __init__(self, engine: PhysicsEngine, body: SimulatedBody, index: int) -> None:
        self._engine, self._body, self._index = engine, body, index
        properties = engine.mass_properties(body.number, index)
        self._mass, self._moments = float(properties.mass), np.array(properties.moments)

    def _motion(self) -> _CentreMotion:
        number = self._body.number
        if self._index == BASE_INDEX:
            centre = self._engine.base_centre(number)
            linear, angular = self._engine.base_twist(number)
        else:
            centre, _, linear, angular = self._engine.link_motion(number, self._index)
        axes = _rotation_matrix(centre.quaternion)
        return _CentreMotion(centre.position, axes, np.array(linear), np.array(angular))

    def _apply_force(self, position: Vector3, force: np.ndarray) -> None:
        self._engine.apply_force(self._body.number, self._index, force.tolist(), position)

    def _apply_torque(self, position: Vector3, torque: np.ndarray) -> None:
        """Applies a torque as a force couple, because PyBullet uses the wrong frame of some links for torques."""
        size = float(np.linalg.norm(torque))
        if size > 0.0:
            arm = np.cross(torque, np.eye(3)[np.argmin(np.abs(torque))])
            arm /= np.linalg.norm(arm)
            for side in (0.5, -0.5):
                x, y, z = (position + side * arm).tolist()
                self._apply_force((x, y, z), 2.0 * side * np.cross(torque, arm))


class _Drag(_LinkForce):
    """Reduces the velocity of a link by a fraction in every step."""

    def __init__(self, engine: PhysicsEngine, body: SimulatedBody, index: int, decay: specs.VelocityDecay) -> None:
        super().__init__(engine, body, index)
        steps = engine.settings.time_step_s / _DECAY_STEP_S
        self._linear, self._angular = (
            -(1.0 - math.pow(1.0 - min(fraction, 1.0), steps)) / engine.settings.time_step_s
            for fraction in (decay.linear, decay.angular)
        )

    def apply(self, gravity: Vector3) -> None:
        """Applies the drag force and torque."""
        del gravity
        position, axes, linear, angular = self._motion()
        self._apply_force(position, self._linear * self._mass * linear)
        self._apply_torque(position, self._angular * (axes @ (self._moments * (axes.T @ angular))))


class _Buoyancy(_LinkForce):
    """Compensates the weight of a link."""

    def apply(self, gravity: Vector3) -> None:
        """Applies the force against gravity."""
        self._apply_force(self._motion().position, -self._mass * np.array(gravity))


def _rotation_matrix(quaternion: Quaternion) -> np.ndarray:
    """Returns the rotation matrix of a quaternion xyzw of any length, shape (3, 3)."""
    x, y, z, w = quaternion
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    xs, ys, zs = x * scale, y * scale, z * scale
    wx, wy, wz = w * xs, w * ys, w * zs
    xx, xy, xz = x * xs, x * ys, x * zs
    yy, yz, zz = y * ys, y * zs, z * zs
    return np.array(
        [
            [1.0 - (yy + zz), xy - wz, xz + wy],
            [xy + wz, 1.0 - (xx + zz), yz - wx],
            [xz - wy, yz + wx, 1.0 - (xx + yy)],
        ]
    )
