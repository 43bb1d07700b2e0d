# SPDX-License-Identifier: BSD-3-Clause
"""An object in a gripper, which moves with the hand along its arc and not along the tangent.

In a step h the engine moves the links of a robot by turning their joints, so along arcs; a free body goes on straight
with its velocity. Friction only makes the velocities equal: in a hand with the acceleration a, an object falls behind
by a h^2 / 2 in every step. That is half a millimetre a second in a hand that turns with 1 rad/s half a metre from the
axis. Here the object is moved by just that difference, which is known: where a point of the hand would be along its
tangent, and where it is. Its velocity is left alone, so that nothing holds it but friction.
"""

from __future__ import annotations

import math

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_engine import PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody, cross
from modular_framework_urdf.rotations import Quaternion, Vector3


class CarriedObject:
    """Moves one object with one hand.

    Args:
        engine: Where both are.
        thing: The object.
        robot: The robot that holds it.
        palm_index: The engine's number of the link that the fingers are fastened to.
    """

    def __init__(self, engine: PhysicsEngine, thing: SimulatedBody, robot: SimulatedBody, palm_index: int) -> None:
        self._engine, self._thing, self._robot, self._palm = engine, thing.number, robot.number, palm_index
        self._thing_in_palm = Pose()
        self._before = Pose()
        self._palm_before = Pose()

    def before_step(self) -> None:
        """Remembers where hand and object are."""
        self._palm_before = self._engine.link_motion(self._robot, self._palm).centre
        self._before = self._engine.base_centre(self._thing)
        self._thing_in_palm = self._palm_before.inverse() @ self._before

    def after_step(self) -> None:
        """Moves the object by what the hand's motion differs from its tangent."""
        palm, _, linear, angular = self._engine.link_motion(self._robot, self._palm)
        carried = palm @ self._thing_in_palm
        lever = _difference(carried.position, palm.position)
        step_s = self._engine.settings.time_step_s
        # This is the velocity at the end of the step: to second order, the tangent there goes beyond the arc by as much
        # as the tangent at the beginning, along which the object went, falls short of it.
        tangent = [step_s * (v + w) for v, w in zip(linear, cross(angular, lever), strict=True)]
        shift = _difference((tangent[0], tangent[1], tangent[2]), _difference(carried.position, self._before.position))
        turned = _rotation_vector((palm @ self._palm_before.inverse()).quaternion)
        turn = _difference((step_s * angular[0], step_s * angular[1], step_s * angular[2]), turned)
        pose, twist = self._engine.base_centre(self._thing), self._engine.base_twist(self._thing)
        x, y, z = (a + b for a, b in zip(pose.position, shift, strict=True))
        rotated = Pose((0.0, 0.0, 0.0), _small_rotation(turn)) @ Pose((0.0, 0.0, 0.0), pose.quaternion)
        self._engine.set_base_centre(self._thing, Pose((x, y, z), rotated.quaternion))
        self._engine.set_base_twist(self._thing, *twist)  # the line above sets it to 0


def _difference(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _rotation_vector(quaternion: Quaternion) -> Vector3:
    x, y, z, w = quaternion if quaternion[3] >= 0.0 else (-each for each in quaternion)
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * math.atan2(sine, w) / sine if sine > 0.0 else 2.0
    return (scale * x, scale * y, scale * z)


def _small_rotation(vector: Vector3) -> Quaternion:
    x, y, z = (0.5 * each for each in vector)
    length = math.sqrt(1.0 + x * x + y * y + z * z)
    return (x / length, y / length, z / length, 1.0 / length)
