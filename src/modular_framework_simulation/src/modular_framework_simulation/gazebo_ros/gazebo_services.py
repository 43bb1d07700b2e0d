# SPDX-License-Identifier: BSD-3-Clause
"""The services of Gazebo, answered by the simulated world.

Each handler runs in a thread of its own, has its work done by the simulation loop, and reports a failure in the answer:
`success` and `status_message`, never an exception.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import rospy
from gazebo_msgs import msg, srv
from geometry_msgs.msg import Vector3
from std_srvs.srv import Empty, EmptyResponse

from modular_framework_simulation.errors import SimulationError
from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.loop.simulation_loop import SimulationLoop
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_specs import Model
from modular_framework_simulation.models.urdf_model import read_urdf_model
from modular_framework_simulation.physics.physics_world import WORLD_FRAMES

_ANSWER_TIMEOUT_S = 30.0


class GazeboServices:
    """Advertises and answers the services of gazebo_msgs.

    Services: see `ros_names`, everything below /gazebo. Subscribes /gazebo/set_model_state (gazebo_msgs/ModelState).

    Args:
        loop: The simulation loop.
        resources: Where spawned models find what they refer to.
    """

    def __init__(self, loop: SimulationLoop, resources: Resources) -> None:
        self._loop = loop
        self._world = loop.world
        self._resources = resources
        self._endpoints: list[Any] = []

    def connect(self) -> None:
        """Advertises everything."""
        for name, read in (
            (ros_names.SPAWN_SDF_MODEL, read_model_text),
            (ros_names.SPAWN_URDF_MODEL, read_urdf_model),
        ):
            self._advertise(name, srv.SpawnModel, self._spawner(name, read))
        for name, kind, work in (
            (ros_names.DELETE_MODEL, srv.DeleteModel, self._delete),
            (ros_names.GET_MODEL_STATE, srv.GetModelState, self._get_model_state),
            (ros_names.SET_MODEL_STATE, srv.SetModelState, self._set_model_state),
            (ros_names.SET_MODEL_CONFIGURATION, srv.SetModelConfiguration, self._set_configuration),
            (ros_names.GET_LINK_STATE, srv.GetLinkState, self._get_link_state),
            (ros_names.GET_MODEL_PROPERTIES, srv.GetModelProperties, self._get_model_properties),
            (ros_names.GET_WORLD_PROPERTIES, srv.GetWorldProperties, self._get_world_properties),
            (ros_names.GET_PHYSICS_PROPERTIES, srv.GetPhysicsProperties, self._get_physics_properties),
        ):
            self._advertise(name, kind, self._looped(name, work))
        for name, action in (
            (ros_names.PAUSE_PHYSICS, self._loop.pause),
            (ros_names.UNPAUSE_PHYSICS, self._loop.unpause),
            (ros_names.RESET_SIMULATION, self._loop.reset_all),
            (ros_names.RESET_WORLD, self._loop.reset_poses),
        ):
            self._endpoints.append(rospy.Service(name, Empty, self._command_handler(name, action)))
        topic = ros_names.SET_MODEL_STATE_TOPIC
        self._endpoints.append(rospy.Subscriber(topic, msg.ModelState, self._on_model_state, queue_size=10))

    def close(self) -> None:
        """Closes all services; may be called twice."""
        while self._endpoints:
            endpoint = self._endpoints.pop()
            if isinstance(endpoint, rospy.Service):
                endpoint.shutdown("the simulation ends")
            else:
                endpoint.unregister()

    def _in_loop(self, what: str, work: Callable[[], Any]) -> Any:
        return self._loop.requests.call(what, work, _ANSWER_TIMEOUT_S)

    def _looped(self, name: str, work: Callable[[Any], Any]) -> Callable[[Any], Any]:
        return lambda request: self._in_loop(name, lambda: work(request))

    def _advertise(self, name: str, kind: Any, work: Callable[[Any], Any]) -> None:
        self._endpoints.append(rospy.Service(name, kind, self._handler(name, work, kind._response_class)))

    def _handler(self, name: str, work: Callable[[Any], Any], response: Any) -> Callable[[Any], Any]:
        def handle(request: Any) -> Any:
            try:
                return work(request)
            except (SimulationError, ValueError) as error:
                rospy.logerr("%s: %s", name, error)
                return response(success=False, status_message=f"{name}: {error}")
            except Exception as error:  # any request must get an answer and must not end the node
                rospy.logerr("%s: unexpected %s: %s", name, type(error).__name__, error)
                return response(success=False, status_message=f"{name}: {type(error).__name__}: {error}")

        return handle

    def _command_handler(self, name: str, action: Callable[[], None]) -> Callable[[Any], Any]:
        def handle(_request: Any) -> EmptyResponse | None:
            try:
                self._in_loop(name, action)
            except SimulationError as error:
                rospy.logerr("%s: %s", name, error)
                return None  # std_srvs/Empty has no field for a failure: rospy reports the failed call
            return EmptyResponse()

        return handle

    def _spawner(self, name: str, read: Callable[[str, str, Resources], Model]) -> Callable[[Any], Any]:
        def spawn(request: Any) -> Any:
            # Reading and decomposing meshes may take seconds: it is done in this thread, while the loop continues.
            model = read(request.model_xml, f"spawn request of '{request.model_name}'", self._resources)
            model = dataclasses.replace(model, name=request.model_name or model.name)
            prepared = self._world.prepare(model)
            initial = conversions.pose_from_msg(request.initial_pose)

            def add() -> None:
                pose = self._world.pose_in_world(initial, request.reference_frame)
                self._world.spawn(dataclasses.replace(model, pose=pose), prepared)

            self._in_loop(name, add)
            return srv.SpawnModelResponse(True, f"spawned model '{model.name}'")

        return spawn

    def _delete(self, request: Any) -> Any:
        if self._world.body(request.model_name).spec is None:
            raise ValueError(f"'{request.model_name}' is the robot that the controllers drive; it cannot be deleted")
        self._world.delete(request.model_name)
        return srv.DeleteModelResponse(True, f"deleted model '{request.model_name}'")

    def _get_model_state(self, request: Any) -> Any:
        reference = request.relative_entity_name
        self._world.body(request.model_name)
        state = self._world.state_relative_to(request.model_name, reference)
        answer = srv.GetModelStateResponse(success=True, status_message="read the state of the model")
        answer.header.stamp = self._stamp()
        answer.header.frame_id = ros_names.WORLD_FRAME if reference in WORLD_FRAMES else reference
        answer.pose = conversions.pose_to_msg(state.pose)
        answer.twist = conversions.twist_to_msg(state.twist)
        return answer

    def _set_model_state(self, request: Any) -> Any:
        self._put(request.model_state)
        return srv.SetModelStateResponse(True, f"put model '{request.model_state.model_name}'")

    def _put(self, model_state: Any) -> None:
        if self._world.body(model_state.model_name).spec is None:
            raise ValueError(f"'{model_state.model_name}' is the robot; it stands where its description says")
        state = conversions.state_from_msgs(model_state.pose, model_state.twist)
        self._world.set_state(model_state.model_name, state, model_state.reference_frame)

    def _on_model_state(self, message: Any) -> None:
        def put() -> None:
            try:
                self._put(message)
            except (SimulationError, ValueError) as error:
                rospy.logerr("%s (topic): %s", ros_names.SET_MODEL_STATE_TOPIC, error)

        self._loop.requests.post(put)

    def _set_configuration(self, request: Any) -> Any:
        names, values = request.joint_names, request.joint_positions
        if len(names) != len(values) or not all(math.isfinite(value) for value in values):
            raise ValueError(f"got {len(names)} joints and positions {list(values)}; give each joint one finite number")
        self._loop.set_joints(request.model_name, dict(zip(names, values, strict=True)))
        return srv.SetModelConfigurationResponse(True, f"set {len(names)} joints of model '{request.model_name}'")

    def _get_link_state(self, request: Any) -> Any:
        reference = request.reference_frame
        state = self._world.state_relative_to(request.link_name, reference)
        answer = srv.GetLinkStateResponse(success=True, status_message="read the state of the link")
        answer.link_state.link_name = request.link_name
        answer.link_state.pose = conversions.pose_to_msg(state.pose)
        answer.link_state.twist = conversions.twist_to_msg(state.twist)
        answer.link_state.reference_frame = ros_names.WORLD_FRAME if reference in WORLD_FRAMES else reference
        return answer

    def _get_model_properties(self, request: Any) -> Any:
        body = self._world.body(request.model_name)
        answer = srv.GetModelPropertiesResponse(success=True, status_message="read the properties of the model")
        answer.body_names = body.link_names()
        answer.canonical_body_name = answer.body_names[0]
        answer.joint_names = list(body.joint_indices)
        answer.is_static = body.static and body.spec is not None
        if body.spec is not None:
            answer.geom_names = [each.name for link in body.spec.links for each in link.collisions]
        return answer

    def _get_world_properties(self, _request: Any) -> Any:
        return srv.GetWorldPropertiesResponse(
            sim_time=self._world.time_ns * 1e-9,
            model_names=self._world.names(),
            rendering_enabled=self._world.engine.has_window,
            success=True,
            status_message="read the properties of the world",
        )

    def _get_physics_properties(self, _request: Any) -> Any:
        settings = self._world.settings
        answer = srv.GetPhysicsPropertiesResponse(success=True, status_message="read the properties of the physics")
        answer.time_step = settings.time_step_s
        answer.pause = self._loop.paused
        answer.max_update_rate = 1.0 / settings.time_step_s
        answer.gravity = Vector3(*self._world.gravity)
        answer.ode_config.sor_pgs_iters = settings.solver_iterations
        answer.ode_config.erp = settings.contact_erp
        return answer

    def _stamp(self) -> Any:
        return rospy.Time(*divmod(self._world.time_ns, 1_000_000_000))
