# SPDX-License-Identifier: BSD-3-Clause
"""Every name the simulation uses on the wire, in one place."""

from __future__ import annotations

NODE = "gazebo"
CLOCK = "/clock"

MODEL_STATES = "/gazebo/model_states"
LINK_STATES = "/gazebo/link_states"
SET_MODEL_STATE_TOPIC = "/gazebo/set_model_state"
GRASPED_OBJECT = "/gazebo/grasped_object"

SPAWN_SDF_MODEL = "/gazebo/spawn_sdf_model"
SPAWN_URDF_MODEL = "/gazebo/spawn_urdf_model"
DELETE_MODEL = "/gazebo/delete_model"
GET_MODEL_STATE = "/gazebo/get_model_state"
SET_MODEL_STATE = "/gazebo/set_model_state"
SET_MODEL_CONFIGURATION = "/gazebo/set_model_configuration"
GET_LINK_STATE = "/gazebo/get_link_state"
GET_MODEL_PROPERTIES = "/gazebo/get_model_properties"
GET_WORLD_PROPERTIES = "/gazebo/get_world_properties"
GET_PHYSICS_PROPERTIES = "/gazebo/get_physics_properties"
PAUSE_PHYSICS = "/gazebo/pause_physics"
UNPAUSE_PHYSICS = "/gazebo/unpause_physics"
RESET_SIMULATION = "/gazebo/reset_simulation"
RESET_WORLD = "/gazebo/reset_world"
HOLD_TIME = "/gazebo/hold_time"
ADVANCE_TIME = "/gazebo/advance_time"
RESTART = "/gazebo/restart"
STATE_DIGEST = "/gazebo/state_digest"

APPLY_PLANNING_SCENE = "/apply_planning_scene"
"""Service of move_group that takes objects and answers when they are in its scene."""
GET_PLANNING_SCENE = "/get_planning_scene"
"""Service of move_group that says which objects its scene has."""
MONITORED_PLANNING_SCENE = "/move_group/monitored_planning_scene"
"""Topic of move_group with every change of its scene."""

WORLD_FRAME = "world"
