# SPDX-License-Identifier: BSD-3-Clause
"""Services for joints: states, settings and efforts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from gazebo_msgs import srv

from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.gazebo_ros.endpoints import Endpoints
from modular_framework_simulation.gazebo_ros.link_services import describe
from modular_framework_simulation.physics.applied_forces import Interval, JointEffort
from modular_framework_simulation.physics.body_joints import (
    JointMeasurement,
    measured_joint,
    movable_joints,
    tree_with_joint,
)
from modular_framework_simulation.physics.model_changes import JointChange, set_joint
from modular_framework_simulation.physics.part_names import PartName, find_joint
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.simulated_body import JointSettings

_UNSUPPORTED_FIELDS = ("erp", "cfm", "stop_erp", "stop_cfm", "fudge_factor")
"""Fields of ODEJointProperties that the physics engine does not support."""


class JointServices:
    """Serves /gazebo/{get,set}_joint_properties, apply_joint_effort and clear_joint_forces.

    Args:
        world: The world, only used by the loop's thread.
    """

    def __init__(self, world: PhysicsWorld) -> None:
        self._world = world

    def connect(self, endpoints: Endpoints) -> None:
        """Advertises the services."""
        endpoints.serve(ros_names.GET_JOINT_PROPERTIES, srv.GetJointProperties, self._get_properties)
        endpoints.serve(ros_names.SET_JOINT_PROPERTIES, srv.SetJointProperties, self._set_properties)
        endpoints.serve(ros_names.APPLY_JOINT_EFFORT, srv.ApplyJointEffort, self._apply_effort)
        endpoints.command(ros_names.CLEAR_JOINT_FORCES, srv.JointRequest, self._clear_forces)

    def _joint(self, name: str) -> PartName:
        return find_joint(self._world.bodies, name)

    def _get_properties(self, request: Any) -> Any:
        joint = self._joint(request.joint_name)
        body = self._world.body(joint.model)
        response = srv.GetJointPropertiesResponse(success=True, status_message="read the properties of the joint")
        if body.spec is not None:
            kind = next(each.kind for each in body.spec.joints if each.name == joint.part)
            response.type = getattr(response, kind.name)
        if joint.part not in movable_joints(body):
            return response
        measured = measured_joint(self._world.engine, body, joint.part)
        if body.spec is None:
            response.type = _kind_of_robot_joint(measured)
        response.damping, response.position, response.rate = (
            [measured.damping],
            [measured.position],
            [measured.velocity],
        )
        return response

    def _set_properties(self, request: Any) -> Any:
        joint, config = self._joint(request.joint_name), request.ode_joint_config
        unsupported = [name for name in _UNSUPPORTED_FIELDS if getattr(config, name)]
        if unsupported:
            raise ValueError(
                f"{', '.join(unsupported)} of ODE have no counterpart in this physics engine; "
                "leave them empty; allowed: damping, hiStop, loStop, fmax, vel"
            )
        settings = JointSettings(
            damping=_single_value(config.damping, "damping", 0.0),
            motor_velocity=_single_value(config.vel, "vel", -math.inf),
            motor_effort=_single_value(config.fmax, "fmax", 0.0),
        )
        if settings.motor_velocity is not None and settings.motor_effort is None:
            current = self._world.body(joint.model).joint_settings.get(joint.part, JointSettings())
            if current.motor_effort is None:
                raise ValueError("got vel without fmax; a motor without maximum effort has no effect; give both")
        change = JointChange(_limit(config.loStop, "loStop"), _limit(config.hiStop, "hiStop"), settings)
        set_joint(self._world, joint, change)
        return srv.SetJointPropertiesResponse(True, f"set the properties of joint '{joint.scoped_name}'")

    def _apply_effort(self, request: Any) -> Any:
        joint = self._joint(request.joint_name)
        tree_with_joint(self._world.body(joint.model), joint.part)
        conversions.check_numbers((request.effort,), "effort", conversions.MAX_FORCE, "Nm or N")
        duration_ns = request.duration.to_nsec()
        if duration_ns == 0:
            return srv.ApplyJointEffortResponse(True, "the duration is 0: no effort acts; use -1 for no end")
        interval = Interval.from_request(self._world.time_ns, request.start_time.to_nsec(), duration_ns)
        self._world.forces.add_effort(JointEffort(joint, request.effort, interval))
        return srv.ApplyJointEffortResponse(True, f"the effort acts on '{joint.scoped_name}' {describe(interval)}")

    def _clear_forces(self, request: Any) -> None:
        self._world.forces.clear_joint(self._joint(request.joint_name))


def _kind_of_robot_joint(measured: JointMeasurement) -> int:
    kinds = srv.GetJointPropertiesResponse
    if measured.prismatic:
        return int(kinds.PRISMATIC)
    return int(kinds.CONTINUOUS if math.isinf(measured.upper) else kinds.REVOLUTE)


def _single_value(values: Sequence[float], noun: str, minimum: float) -> float | None:
    """Returns the value of the single axis; None if not given."""
    if len(values) > 1:
        raise ValueError(f"{noun} has {len(values)} values; expected one value, because every joint has one axis")
    for value in values:
        conversions.check_numbers((value,), noun, conversions.MAX_FORCE, "in SI units")
        if value < minimum:
            raise ValueError(f"{noun} is {value:g}; allowed: {minimum:g} or greater")
        return float(value)
    return None


def _limit(values: Sequence[float], noun: str) -> float | None:
    """Returns the limit of the single axis, which may be infinite; None if not given."""
    if len(values) == 1 and math.isinf(values[0]):
        return float(values[0])
    return _single_value(values, noun, -math.inf)
