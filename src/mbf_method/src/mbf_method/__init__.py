# SPDX-License-Identifier: BSD-3-Clause
"""Serves a method from its own Python environment to the framework, without ROS."""

from mbf_method.actions import Actions, task_done
from mbf_method.grasp_request import CameraView, GraspRequest, Gripper, RobotState, SceneObject
from mbf_method.grasps import Grasps
from mbf_method.joint_path import JointPath, no_path
from mbf_method.observation import ActionSpec, CameraImages, Observation
from mbf_method.path_request import Obstacle, PathRequest
from mbf_method.served_method import ServedMethod, grasp_method, planner, policy

__all__ = [
    "ActionSpec",
    "Actions",
    "CameraImages",
    "CameraView",
    "GraspRequest",
    "Grasps",
    "Gripper",
    "JointPath",
    "Observation",
    "Obstacle",
    "PathRequest",
    "RobotState",
    "SceneObject",
    "ServedMethod",
    "grasp_method",
    "no_path",
    "planner",
    "policy",
    "task_done",
]
