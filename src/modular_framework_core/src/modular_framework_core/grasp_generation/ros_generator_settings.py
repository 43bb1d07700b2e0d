# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameters that all grasp generators have, and refuses values that make no sense."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import rospy

from modular_framework_core.grasp_generation.grasp_candidates import ReadNumber
from modular_framework_core.grasp_generation.hand_motion_settings import HandMotionSettings
from modular_framework_core.grasp_generation.hand_poses import HandSettings
from modular_framework_core.grasp_generation.pair_grasps import PairGraspSettings
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox

DEFAULT_SEED, LARGEST_SEED = 1, 2**63 - 1


@dataclass(frozen=True, slots=True)
class GeneratorSettings:
    """Parameters of a grasp generator.

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
        seed: Seed of every random choice (``/seed``).
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
    seed: int


def read_settings() -> GeneratorSettings:
    """Reads the parameters; a value out of range is replaced by its default, and that is logged."""
    low = tuple(number(f"min_{axis}_crop", default) for axis, default in zip("xyz", (-0.345, 0.2, 0.84), strict=True))
    high = tuple(number(f"max_{axis}_crop", default) for axis, default in zip("xyz", (0.355, 0.9, 1.35), strict=True))
    return GeneratorSettings(
        frame=str(rospy.get_param("origin_frame_name", "world")),
        crop=CropBox((low[0], low[1], low[2]), (high[0], high[1], high[2])),
        arm_group=str(rospy.get_param("arm_group_name", "arm_and_manipulator")),
        gripper_joint=str(rospy.get_param("~gripper_joint", "")),
        object_name=str(rospy.get_param("~object_name", "")),
        name_prefix=str(rospy.get_param("~name_prefix", "")),
        hand_id=str(rospy.get_param("manipulator_group_name", "")),
        torque=number("~torque_intensity", 1.0, 0.01, 1.0),
        max_grasps=int(number("~max_grasps", 8, 1, 1000)),
        max_checks=int(number("~max_checks", 40, 1, 100000)),
        check_reachability=bool(rospy.get_param("~check_reachability", True)),
        scene_timeout_s=number("~scene_timeout", 20.0, 0.0, 3600.0),
        seed=int(number("/seed", DEFAULT_SEED, 0, LARGEST_SEED)),
    )


def number(name: str, default: float, low: float = -math.inf, high: float = math.inf) -> float:
    """Reads a number; one out of range is replaced by the default, and that is logged.

    Args:
        name: Parameter.
        default: Value when it is not set, or wrong.
        low: Smallest value that is allowed.
        high: Greatest value that is allowed.
    """
    value = rospy.get_param(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        rospy.logerr_throttle(
            10.0,
            f"Parameter '{rospy.resolve_name(name)}' is {value!r}, allowed is a number from "
            f"{low} to {high}; {default} is used instead.",
        )
        return float(default)
    return float(value)


def read_hand_motion(read: ReadNumber = number) -> HandMotionSettings:
    """Reads the parameters that grasp methods share.

    Args:
        read: Reads a parameter; by default from the parameter server.
    """
    defaults = HandMotionSettings()
    return HandMotionSettings(
        approach_distance_m=read("~approach_distance", defaults.approach_distance_m, 0.01, 0.5),
        lift_distance_m=read("~lift_distance", defaults.lift_distance_m, 0.0, 1.0),
        finger_clearance_m=read("~finger_clearance", defaults.finger_clearance_m, 0.0, 0.1),
        min_finger_clearance_m=read("~min_finger_clearance", defaults.min_finger_clearance_m, 0.0, 0.1),
        tip_clearance_m=read("~tip_clearance", defaults.tip_clearance_m, 0.0, 0.1),
        min_pad_overlap_m=read("~min_pad_overlap", defaults.min_pad_overlap_m, 0.001, 0.1),
    )


def read_pair_grasps(cone_cosine: float, read: ReadNumber = number) -> PairGraspSettings:
    """Reads the parameters of methods that begin with pairs of contacts.

    Args:
        cone_cosine: Cosine of the half angle of the friction cone.
        read: Reads a parameter; by default from the parameter server.
    """
    hand, defaults = HandSettings(), PairGraspSettings()
    hand = HandSettings(
        **asdict(read_hand_motion(read)),
        approach_step_rad=read("~approach_step", hand.approach_step_rad, 0.05, math.pi),
        max_approach_angle_rad=read("~max_approach_angle", hand.max_approach_angle_rad, 0.01, math.pi),
        cone_cosine=cone_cosine,
    )
    return PairGraspSettings(
        hand=hand,
        full_clearance_m=read("~full_clearance", defaults.full_clearance_m, 0.001, 1.0),
        max_poses=int(read("~max_poses", defaults.max_poses, 1, 1000000)),
        max_candidates=int(read("~max_candidates", defaults.max_candidates, 1, 1000000)),
    )


class ParameterisedMethod:
    """Base of a grasp method whose parameters are read again for every object.

    Args:
        read: Reads a parameter; by default from the parameter server.
    """

    def __init__(self, read: ReadNumber = number) -> None:
        """Reads nothing yet."""
        self.read = read
