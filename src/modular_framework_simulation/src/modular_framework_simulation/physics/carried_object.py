# SPDX-License-Identifier: BSD-3-Clause
"""Moves a held object with the gripper along the gripper's arc instead of the tangent.

In a step h, the engine moves the links of a robot by rotating their joints, so the links move along arcs. A free body
moves along a straight line. Friction only equalizes the velocities: in a gripper with the acceleration a, an object
lags by a h^2 / 2 in every step. The lag is half a millimetre per second if the gripper rotates at 1 rad/s at a distance
of half a metre from the axis. This module shifts the object by the known difference between the tangent and the actual
path. The velocity of the object does not change, so only friction holds the object.
"""

from __future__ import annotations

import math

from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_engine import PhysicsEngine
from modular_framework_simulation.physics.simulated_body import SimulatedBody, cross
from modular_framework_urdf.rotations import Quaternion, Vector3


class CarriedObject:
    """Moves a held object with a gripper.

    Args:
        engine: The physics engine.
        held_object: The held object.
        robot: The robot that holds the object.
        palm_index: Engine link index of the palm.
    """

    def __init__(
        self, engine: PhysicsEngine, held_object: SimulatedBody, robot: SimulatedBody, palm_index: int
    ) -> None:
        self._engine, self._object_id, self._robot_id, self._palm = engine, held_object.number, robot.number, palm_index
        self._object_in_palm = Pose()
        self._object_before = Pose()
        self._palm_before = Pose()

    def before_step(self) -> None:
        """Stores the poses of the palm and the object."""
        self._palm_before = self._engine.link_motion(self._robot_id, self._palm).centre
        self._object_before = self._engine.base_centre(self._object_id)
        self._object_in_palm = self._palm_before.inverse() @ self._object_before

    def after_step(self) -> None:
        """Shifts the object by the difference between the palm's path and its tangent."""
        palm, _, linear, angular = self._engine.link_motion(self._robot_id, self._palm)
        carried = palm @ self._object_in_palm
        lever = _difference(carried.position, palm.position)
        step_s = self._engine.settings.time_step_s
        # `linear` and `angular` are the velocities at the end of the step, but the object moved along the tangent at
        # the start. To second order, both tangents deviate from the arc by the same distance, in opposite directions.
        tangent = [step_s * (v + w) for v, w in zip(linear, cross(angular, lever), strict=True)]
        shift = _difference(
            (tangent[0], tangent[1], tangent[2]), _difference(carried.position, self._object_before.position)
        )
        palm_rotation = _rotation_vector((palm @ self._palm_before.inverse()).quaternion)
        rotation_error = _difference((step_s * angular[0], step_s * angular[1], step_s * angular[2]), palm_rotation)
        pose, twist = self._engine.base_centre(self._object_id), self._engine.base_twist(self._object_id)
        x, y, z = (a + b for a, b in zip(pose.position, shift, strict=True))
        rotated = Pose((0.0, 0.0, 0.0), _small_rotation(rotation_error)) @ Pose((0.0, 0.0, 0.0), pose.quaternion)
        self._engine.set_base_centre(self._object_id, Pose((x, y, z), rotated.quaternion))
        self._engine.set_base_twist(self._object_id, *twist)  # set_base_centre has reset the velocity


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
