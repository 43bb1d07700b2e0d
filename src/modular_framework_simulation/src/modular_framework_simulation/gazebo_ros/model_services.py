# SPDX-License-Identifier: BSD-3-Clause
"""Services and a topic for models: spawning, deleting, reading and placing."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from typing import Any

import rospy
from gazebo_msgs import msg, srv

from modular_framework_simulation.errors import ModelChangeError
from modular_framework_simulation.gazebo_ros import conversions, ros_names
from modular_framework_simulation.gazebo_ros.endpoints import Endpoints
from modular_framework_simulation.gazebo_ros.world_topics import stamp_of
from modular_framework_simulation.loop.simulation_loop import SimulationLoop
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.models.sdf_specs import Model
from modular_framework_simulation.models.urdf_model import read_urdf_model
from modular_framework_simulation.models.xml_nodes import parse_xml
from modular_framework_simulation.physics.part_names import find_frame
from modular_framework_simulation.physics.physics_world import WORLD_FRAMES


class ModelServices:
    """Serves /gazebo/spawn_{sdf,urdf,gazebo}_model, delete_model, {get,set}_model_state, get_model_properties.

    Also serves set_model_configuration. Subscribes: /gazebo/set_model_state (gazebo_msgs/ModelState).

    Args:
        loop: Loop with the world.
        resources: Folders and packages for the files of spawned models.
    """

    def __init__(self, loop: SimulationLoop, resources: Resources) -> None:
        self._loop, self._world, self._resources = loop, loop.world, resources
        self._endpoints = Endpoints(loop)
        self._reads: Counter[str] = Counter()

    def connect(self, endpoints: Endpoints) -> None:
        """Advertises the services and subscribes to the topic."""
        self._endpoints = endpoints
        endpoints.serve_outside_loop(ros_names.SPAWN_SDF_MODEL, srv.SpawnModel, self._spawn_sdf)
        endpoints.serve_outside_loop(ros_names.SPAWN_URDF_MODEL, srv.SpawnModel, self._spawn_urdf)
        endpoints.serve_outside_loop(ros_names.SPAWN_GAZEBO_MODEL, srv.SpawnModel, self._spawn_gazebo)
        endpoints.serve(ros_names.DELETE_MODEL, srv.DeleteModel, self._delete)
        endpoints.serve(ros_names.GET_MODEL_STATE, srv.GetModelState, self._get_state)
        endpoints.serve(ros_names.SET_MODEL_STATE, srv.SetModelState, self._set_state)
        endpoints.serve(ros_names.SET_MODEL_CONFIGURATION, srv.SetModelConfiguration, self._set_configuration)
        endpoints.serve(ros_names.GET_MODEL_PROPERTIES, srv.GetModelProperties, self._get_properties)
        endpoints.subscribe(ros_names.SET_MODEL_STATE, msg.ModelState, self._apply_state)

    def _frame(self, name: str) -> str:
        return find_frame(self._world.bodies, name, WORLD_FRAMES)

    def _spawn_sdf(self, request: Any) -> Any:
        """Spawns a model in SDF or, as in Gazebo, in URDF."""
        source = f"spawn request of '{request.model_name}'"
        is_urdf = parse_xml(request.model_xml, source).tag == "robot"
        read_model = read_urdf_model if is_urdf else read_model_text
        return self._spawn(ros_names.SPAWN_SDF_MODEL, request, read_model(request.model_xml, source, self._resources))

    def _spawn_urdf(self, request: Any) -> Any:
        source = f"spawn request of '{request.model_name}'"
        model = read_urdf_model(request.model_xml, source, self._resources)
        return self._spawn(ros_names.SPAWN_URDF_MODEL, request, model)

    def _spawn_gazebo(self, request: Any) -> Any:
        rospy.logwarn("%s is deprecated: use %s", ros_names.SPAWN_GAZEBO_MODEL, ros_names.SPAWN_SDF_MODEL)
        return self._spawn_sdf(request)

    def _spawn(self, service: str, request: Any, model: Model) -> Any:
        # Decomposing meshes may take seconds, so this thread prepares the model while the loop continues.
        name = request.model_name or model.name
        model = dataclasses.replace(model, name=name, namespace=request.robot_namespace)
        if model.name in WORLD_FRAMES:
            raise ValueError(f"a model cannot have the name '{model.name}', which stands for the world frame")
        prepared = self._world.prepare(model)
        initial = conversions.pose_from_msg(request.initial_pose) @ model.pose

        def add() -> None:
            pose = self._world.pose_in_world(initial, self._frame(request.reference_frame))
            self._world.spawn(dataclasses.replace(model, pose=pose), prepared)

        self._endpoints.in_loop(service, add)
        return srv.SpawnModelResponse(True, f"spawned model '{model.name}'")

    def _delete(self, request: Any) -> Any:
        if self._world.body(request.model_name).spec is None:
            raise ModelChangeError(f"'{request.model_name}' is the controlled robot and cannot be deleted")
        self._world.delete(request.model_name)
        del self._reads[request.model_name]
        return srv.DeleteModelResponse(True, f"deleted model '{request.model_name}'")

    def _get_state(self, request: Any) -> Any:
        reference = self._frame(request.relative_entity_name)
        self._world.body(request.model_name)
        state = self._world.state_relative_to(request.model_name, reference)
        self._reads[request.model_name] += 1
        response = srv.GetModelStateResponse(success=True, status_message="read the state of the model")
        response.header.seq = self._reads[request.model_name]
        response.header.stamp = stamp_of(self._world)
        response.header.frame_id = ros_names.WORLD_FRAME if reference in WORLD_FRAMES else reference
        response.pose = conversions.pose_to_msg(state.pose)
        response.twist = conversions.twist_to_msg(state.twist)
        return response

    def _set_state(self, request: Any) -> Any:
        self._apply_state(request.model_state)
        return srv.SetModelStateResponse(True, f"set the state of model '{request.model_state.model_name}'")

    def _apply_state(self, model_state: Any) -> None:
        if self._world.body(model_state.model_name).spec is None:
            raise ModelChangeError(f"'{model_state.model_name}' is the robot, whose base pose is fixed")
        state = conversions.state_from_msgs(model_state.pose, model_state.twist)
        self._world.set_state(model_state.model_name, state, self._frame(model_state.reference_frame))

    def _set_configuration(self, request: Any) -> Any:
        names, values = request.joint_names, request.joint_positions
        if len(names) != len(values) or not all(math.isfinite(value) for value in values):
            raise ValueError(f"got {len(names)} joints and positions {list(values)}; give one finite number per joint")
        self._loop.set_joints(request.model_name, dict(zip(names, values, strict=True)))
        return srv.SetModelConfigurationResponse(True, f"set {len(names)} joints of model '{request.model_name}'")

    def _get_properties(self, request: Any) -> Any:
        body = self._world.body(request.model_name)
        response = srv.GetModelPropertiesResponse(success=True, status_message="read the properties of the model")
        response.body_names = body.link_names()
        response.canonical_body_name = response.body_names[0]
        response.joint_names = body.joint_names()
        response.is_static = body.static and body.spec is not None
        if body.spec is not None:
            response.geom_names = [each.name for link in body.spec.links for each in link.collisions]
        return response
