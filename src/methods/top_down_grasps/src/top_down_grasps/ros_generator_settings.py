# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameters of the grasp generator, and refuses values that make no sense."""

from __future__ import annotations

import math
from dataclasses import dataclass

import rospy

from top_down_grasps.planning_scene_objects import CropBox
from top_down_grasps.top_down import TopDownSettings


@dataclass(frozen=True, slots=True)
class GeneratorSettings:
    """Parameters of the generator.

    Attributes:
        frame: Frame of the crop box and of the grasps (``origin_frame_name``).
        crop: Where objects are looked for (``min_x_crop`` ... ``max_z_crop``).
        arm_group: Planning group whose tip is the grasp frame (``arm_group_name``).
        gripper_joint: Actuated joint of the gripper (``~gripper_joint``); it has no default.
        object_name: Object to grasp; empty for all in the crop box (``~object_name``).
        name_prefix: Grasps are stored as <prefix>1, <prefix>2, ...; empty stores them anonymously (``~name_prefix``).
        hand_id: Written into the grasps (``manipulator_group_name``).
        torque: Torque intensity of the grasp in (0, 1] (``~torque_intensity``).
        max_grasps: Greatest number of grasps to store (``~max_grasps``).
        max_checks: Greatest number of grasps whose reachability is checked (``~max_checks``).
        check_reachability: Whether inverse kinematics must have a solution at every stage (``~check_reachability``).
        scene_timeout_s: Wait for an object before failure is signalled [s of the ROS clock] (``~scene_timeout``).
        top_down: What counts as a usable grasp.
    """

    frame: str
    crop: CropBox
    arm_group: str
    gripper_joint: str
    object_name: str
    name_prefix: str
    hand_id: str
    torque: float
    max_grasps: int
    max_checks: int
    check_reachability: bool
    scene_timeout_s: float
    top_down: TopDownSettings


def read_settings() -> GeneratorSettings:
    """Reads the parameters; a value out of range is replaced by its default, and that is logged."""
    low = tuple(_number(f"min_{axis}_crop", default) for axis, default in zip("xyz", (-0.345, 0.2, 0.84), strict=True))
    high = tuple(_number(f"max_{axis}_crop", default) for axis, default in zip("xyz", (0.355, 0.9, 1.35), strict=True))
    defaults = TopDownSettings()
    top_down = TopDownSettings(
        approach_distance_m=_number("~approach_distance", defaults.approach_distance_m, 0.01, 0.5),
        lift_distance_m=_number("~lift_distance", defaults.lift_distance_m, 0.0, 1.0),
        finger_clearance_m=_number("~finger_clearance", defaults.finger_clearance_m, 0.0, 0.1),
        min_finger_clearance_m=_number("~min_finger_clearance", defaults.min_finger_clearance_m, 0.0, 0.1),
        tip_clearance_m=_number("~tip_clearance", defaults.tip_clearance_m, 0.0, 0.1),
        min_pad_overlap_m=_number("~min_pad_overlap", defaults.min_pad_overlap_m, 0.001, 0.1),
        min_side_alignment=_number("~min_side_alignment", defaults.min_side_alignment, 0.5, 0.999),
        yaw_step_rad=_number("~yaw_step", defaults.yaw_step_rad, 0.02, math.pi),
        place_step_m=_number("~place_step", defaults.place_step_m, 0.002, 0.5),
        best_reach_m=_number("~best_reach", defaults.best_reach_m, 0.0, 10.0),
        base_xy_m=(_number("~base_x", 0.0), _number("~base_y", 0.0)),
    )
    return GeneratorSettings(
        frame=str(rospy.get_param("origin_frame_name", "world")),
        crop=CropBox((low[0], low[1], low[2]), (high[0], high[1], high[2])),
        arm_group=str(rospy.get_param("arm_group_name", "arm_and_manipulator")),
        gripper_joint=str(rospy.get_param("~gripper_joint", "")),
        object_name=str(rospy.get_param("~object_name", "")),
        name_prefix=str(rospy.get_param("~name_prefix", "")),
        hand_id=str(rospy.get_param("manipulator_group_name", "")),
        torque=_number("~torque_intensity", 1.0, 0.01, 1.0),
        max_grasps=int(_number("~max_grasps", 8, 1, 1000)),
        max_checks=int(_number("~max_checks", 40, 1, 100000)),
        check_reachability=bool(rospy.get_param("~check_reachability", True)),
        scene_timeout_s=_number("~scene_timeout", 20.0, 0.0, 3600.0),
        top_down=top_down,
    )


def _number(name: str, default: float, low: float = -math.inf, high: float = math.inf) -> float:
    value = rospy.get_param(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        rospy.logerr_throttle(
            10.0,
            f"Parameter '{rospy.resolve_name(name)}' is {value!r}, allowed is a number from "
            f"{low} to {high}; {default} is used instead.",
        )
        return float(default)
    return float(value)
