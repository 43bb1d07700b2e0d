# SPDX-License-Identifier: BSD-3-Clause
"""Services and a topic for links: states, masses and forces."""

from __future__ import annotations

from typing import Any

from gazebo_msgs import msg, srv

from modular_framework_simulation.errors import ModelChangeError
from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.gazebo_ros.endpoints import Endpoints
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_specs import Inertial
from modular_framework_simulation.physics.applied_forces import Interval, LinkWrench
from modular_framework_simulation.physics.body_links import centre_in_world, link_mass, measured_inertial
from modular_framework_simulation.physics.model_changes import has_weight, set_inertial, set_link_state
from modular_framework_simulation.physics.part_names import PartName, find_frame, find_link
from modular_framework_simulation.physics.physics_world import WORLD_FRAMES, PhysicsWorld
from modular_framework_simulation.physics.simulated_body import add, cross
from modular_framework_urdf.rotations import Vector3, rotate_vector


class LinkServices:
    """Serves /gazebo/{get,set}_link_state, {get,set}_link_properties, apply_body_wrench and clear_body_wrenches.

    Subscribes: /gazebo/set_link_state (gazebo_msgs/LinkState).

    Args:
        world: The world, only used by the loop's thread.
    """

    def __init__(self, world: PhysicsWorld) -> None:
        self._world = world

    def connect(self, endpoints: Endpoints) -> None:
        """Advertises the services and subscribes to the topic."""
        endpoints.serve(ros_names.GET_LINK_STATE, srv.GetLinkState, self._get_state)
        endpoints.serve(ros_names.SET_LINK_STATE, srv.SetLinkState, self._set_state)
        endpoints.serve(ros_names.GET_LINK_PROPERTIES, srv.GetLinkProperties, self._get_properties)
        endpoints.serve(ros_names.SET_LINK_PROPERTIES, srv.SetLinkProperties, self._set_properties)
        endpoints.serve(ros_names.APPLY_BODY_WRENCH, srv.ApplyBodyWrench, self._apply_wrench)
        endpoints.command(ros_names.CLEAR_BODY_WRENCHES, srv.BodyRequest, self._clear_wrenches)
        endpoints.subscribe(ros_names.SET_LINK_STATE, msg.LinkState, self._apply_state)

    def _link(self, name: str) -> PartName:
        return find_link(self._world.bodies, name)

    def _frame(self, name: str) -> str:
        return find_frame(self._world.bodies, name, WORLD_FRAMES)

    def _get_state(self, request: Any) -> Any:
        link, reference = self._link(request.link_name), self._frame(request.reference_frame)
        state = self._world.state_relative_to(link.scoped_name, reference)
        response = srv.GetLinkStateResponse(success=True, status_message="read the state of the link")
        response.link_state.link_name = request.link_name
        response.link_state.pose = conversions.pose_to_msg(state.pose)
        response.link_state.twist = conversions.twist_to_msg(state.twist)
        response.link_state.reference_frame = ros_names.WORLD_FRAME if reference in WORLD_FRAMES else reference
        return response

    def _set_state(self, request: Any) -> Any:
        self._apply_state(request.link_state)
        return srv.SetLinkStateResponse(True, f"set the state of link '{request.link_state.link_name}'")

    def _apply_state(self, link_state: Any) -> None:
        link, reference = self._link(link_state.link_name), self._frame(link_state.reference_frame)
        state = conversions.state_from_msgs(link_state.pose, link_state.twist)
        set_link_state(self._world, link, state, reference)

    def _get_properties(self, request: Any) -> Any:
        link = self._link(request.link_name)
        inertial = measured_inertial(self._world.engine, self._world.body(link.model), link.part)
        response = srv.GetLinkPropertiesResponse(success=True, status_message="read the properties of the link")
        response.com = conversions.pose_to_msg(inertial.pose)
        response.gravity_mode = has_weight(self._world.body(link.model), link.part)
        response.mass = inertial.mass
        response.ixx, response.ixy, response.ixz, response.iyy, response.iyz, response.izz = inertial.inertia
        return response

    def _set_properties(self, request: Any) -> Any:
        link = self._link(request.link_name)
        moments = (request.ixx, request.ixy, request.ixz, request.iyy, request.iyz, request.izz)
        conversions.check_numbers((request.mass,), "mass", conversions.MAX_MASS, "kg")
        conversions.check_numbers(moments, "inertia", conversions.MAX_MASS, "kg m^2")
        inertial = Inertial(conversions.pose_from_msg(request.com), request.mass, moments)
        if not request.gravity_mode:
            self._require_movable(link)
        changed = set_inertial(self._world, link, inertial, request.gravity_mode)
        mass = "new properties" if changed else "unchanged properties"
        weight = "gravity acts on it" if request.gravity_mode else "gravity does not act on it"
        return srv.SetLinkPropertiesResponse(True, f"link '{link.scoped_name}': {mass}; {weight}")

    def _require_movable(self, link: PartName) -> None:
        """Raises ModelChangeError for links that forces cannot move."""
        body = self._world.body(link.model)
        fixed_to_world = body.static and body.spec is not None
        if fixed_to_world or link_mass(self._world.engine, body, link.part) == 0.0:
            raise ModelChangeError(f"link '{link.scoped_name}' is fixed to the world; forces do not move it")

    def _apply_wrench(self, request: Any) -> Any:
        link, reference = self._link(request.body_name), self._frame(request.reference_frame)
        self._require_movable(link)
        force = conversions.vector_from_msg(request.wrench.force, "force", conversions.MAX_FORCE, "N")
        torque = conversions.vector_from_msg(request.wrench.torque, "torque", conversions.MAX_FORCE, "Nm")
        point = conversions.vector_from_msg(
            request.reference_point, "reference point", conversions.MAX_COORDINATE_M, "m"
        )
        force, torque, lever = self._in_world(link, reference, (force, torque, point))
        now_ns, duration_ns = self._world.time_ns, request.duration.to_nsec()
        if duration_ns == 0:
            return srv.ApplyBodyWrenchResponse(True, "the duration is 0: no force acts; use -1 for no end")
        interval = Interval.from_request(now_ns, request.start_time.to_nsec(), duration_ns)
        self._world.forces.add_wrench(LinkWrench(link, force, add(torque, cross(lever, force)), interval))
        return srv.ApplyBodyWrenchResponse(True, f"the wrench acts on '{link.scoped_name}' {describe(interval)}")

    def _in_world(
        self, link: PartName, reference: str, wrench: tuple[Vector3, Vector3, Vector3]
    ) -> tuple[Vector3, Vector3, Vector3]:
        """Returns force, torque and lever from the centre of mass, in the world frame.

        As in Gazebo, a point in the world frame is relative to the link's centre of mass; a point in another frame is
        absolute.
        """
        force, torque, point = wrench
        if reference in WORLD_FRAMES:
            return force, torque, point
        frame = self._world.entity_state(reference).pose
        centre = centre_in_world(self._world.engine, self._world.body(link.model), link.part).position
        x, y, z = (a - b for a, b in zip((frame @ Pose(point)).position, centre, strict=True))
        return rotate_vector(frame.quaternion, force), rotate_vector(frame.quaternion, torque), (x, y, z)

    def _clear_wrenches(self, request: Any) -> None:
        self._world.forces.clear_link(self._link(request.body_name))


def describe(interval: Interval) -> str:
    """Returns a text that describes an interval."""
    start = f"from {interval.start_ns * 1e-9:.9g} s"
    return f"{start} until it is cleared" if interval.end_ns is None else f"{start} to {interval.end_ns * 1e-9:.9g} s"
