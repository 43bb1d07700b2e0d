# SPDX-License-Identifier: BSD-3-Clause
"""Forces on models that the engine has no setting for: springs of joints, drag, and links without weight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.physics.joint_resistance import inverse_mass_matrix
from modular_framework_simulation.physics.physics_engine import BASE_INDEX, PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody
from modular_framework_urdf.rotations import Quaternion, Vector3

_DECAY_STEP_S = 1e-3
"""A decay takes a share of the velocity in every step of Gazebo [s]; that is its default step."""


class BodyForce(Protocol):
    """A force that has to be applied before every step."""

    def apply(self, gravity: Vector3) -> None:
        """Applies it for one step; gravity in m/s^2."""


def forces_of(engine: PhysicsEngine, body: SimulatedBody, model: specs.Model) -> tuple[BodyForce, ...]:
    """Returns the forces on one tree of a model; none for most models.

    Args:
        engine: Where the body is.
        body: The tree; its joints are where they start.
        model: Its description.
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
    """The spring of a joint; `mobility` is the acceleration per force on it [1/(kg m^2) or 1/kg]."""

    engine: PhysicsEngine
    body: SimulatedBody
    joint: str
    dynamics: specs.JointDynamics
    mobility: float

    def apply(self, gravity: Vector3) -> None:
        """Pulls the joint towards its reference."""
        del gravity
        step_s, index = self.engine.settings.time_step_s, self.body.joint_indices[self.joint]
        ((position, velocity, _),) = self.engine.joint_states(self.body.number, [index])
        stretch, stiffness = position - self.dynamics.spring_reference, self.dynamics.spring_stiffness
        # As it is at the start of the step the force keeps the energy of a vibration; a spring that is too stiff for
        # that (its vibration is not much slower than the steps) is taken as it will be at the end.
        stiff = stiffness * step_s * step_s * self.mobility
        force = -stiffness * (stretch if stiff < 1.0 else (stretch + step_s * velocity) / (1.0 + stiff))
        self.engine.apply_effort(self.body.number, index, force)


class _OnLink:
    """What a force needs to know of the link it acts on."""

    def __init__(self, engine: PhysicsEngine, body: SimulatedBody, index: int) -> None:
        self._engine, self._body, self._index = engine, body, index
        present = engine.mass_properties(body.number, index)
        self._mass, self._moments = float(present.mass), np.array(present.moments)

    def _motion(self) -> tuple[Vector3, np.ndarray, np.ndarray, np.ndarray]:
        """Returns position, axes, velocity and angular velocity of the centre of mass in the world."""
        number = self._body.number
        if self._index == BASE_INDEX:
            centre = self._engine.base_centre(number)
            linear, angular = self._engine.base_twist(number)
        else:
            centre, _, linear, angular = self._engine.link_motion(number, self._index)
        return centre.position, _rotation_matrix(centre.quaternion), np.array(linear), np.array(angular)

    def _push(self, position: Vector3, force: np.ndarray) -> None:
        self._engine.apply_force(self._body.number, self._index, force.tolist(), position)

    def _turn(self, position: Vector3, torque: np.ndarray) -> None:
        """Lets two forces turn the link: PyBullet's function for torques mistakes the frame of some links."""
        size = float(np.linalg.norm(torque))
        if size > 0.0:
            arm = np.cross(torque, np.eye(3)[np.argmin(np.abs(torque))])
            arm /= np.linalg.norm(arm)
            for side in (0.5, -0.5):
                x, y, z = (position + side * arm).tolist()
                self._push((x, y, z), 2.0 * side * np.cross(torque, arm))


class _Drag(_OnLink):
    """Takes a share of the velocity of a link in every step."""

    def __init__(self, engine: PhysicsEngine, body: SimulatedBody, index: int, decay: specs.VelocityDecay) -> None:
        super().__init__(engine, body, index)
        steps = engine.settings.time_step_s / _DECAY_STEP_S
        self._linear, self._angular = (
            -(1.0 - math.pow(1.0 - min(share, 1.0), steps)) / engine.settings.time_step_s
            for share in (decay.linear, decay.angular)
        )

    def apply(self, gravity: Vector3) -> None:
        """Brakes the link."""
        del gravity
        position, axes, linear, angular = self._motion()
        self._push(position, self._linear * self._mass * linear)
        self._turn(position, self._angular * (axes @ (self._moments * (axes.T @ angular))))


class _Buoyancy(_OnLink):
    """Carries the weight of a link."""

    def apply(self, gravity: Vector3) -> None:
        """Pushes the link up."""
        position, *_ = self._motion()
        self._push(position, -self._mass * np.array(gravity))


def _rotation_matrix(quaternion: Quaternion) -> np.ndarray:
    """Returns the rotation of a quaternion (xyzw) of any length, 3 x 3."""
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
