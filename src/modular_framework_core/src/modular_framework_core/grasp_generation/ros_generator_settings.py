# SPDX-License-Identifier: BSD-3-Clause
"""Reads the common parameters of all grasp generators, declared in parameters/grasp_generator.yaml."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import rospy

from modular_framework_core.grasp_generation.grasp_candidates import ReadNumber
from modular_framework_core.grasp_generation.gripper_geometry import GripperGeometryError, driven_joint
from modular_framework_core.grasp_generation.hand_motion_settings import HandMotionSettings
from modular_framework_core.grasp_generation.hand_poses import HandSettings
from modular_framework_core.grasp_generation.pair_grasps import PairGraspSettings
from modular_framework_core.grasp_generation.planning_scene_objects import CropBox
from modular_framework_ros.declared_parameters import DeclaredParameters


@dataclass(frozen=True, slots=True)
class GeneratorSettings:
    """Parameters of a grasp generator.

    Attributes:
        frame: Frame of the crop box and of the grasps (``origin_frame_name``).
        crop: Search volume for objects (``min_x_crop`` ... ``max_z_crop``).
        arm_group: Planning group whose tip is the grasp frame (``arm_group_name``).
        gripper_joint: Actuated joint of the gripper; empty for the only driven joint of the hand (``~gripper_joint``).
        object_name: Object to grasp; empty for all objects in the crop box (``~object_name``).
        name_prefix: Prefix of the grasp names <prefix>1, <prefix>2, ...; empty for anonymous grasps (``~name_prefix``).
        hand_id: Hand id of the grasps (``manipulator_group_name``).
        torque: Torque intensity of the grasp in (0, 1] (``~torque_intensity``).
        max_grasps: Maximum number of stored grasps (``~max_grasps``).
        max_checks: Maximum number of reachability checks (``~max_checks``).
        check_reachability: Whether every stage of a grasp needs a solution of inverse kinematics
            (``~check_reachability``).
        scene_timeout_s: Maximum wait for an object [s of the ROS clock] (``~scene_timeout``).
        seed: Seed of all random numbers (``/seed``).
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
    """Reads the parameters.

    Raises:
        ParameterError: A parameter is missing or invalid.
    """
    read = DeclaredParameters("modular_framework_core", "grasp_generator").value
    low, high = ([read(f"{end}_{axis}_crop") for axis in "xyz"] for end in ("min", "max"))
    return GeneratorSettings(
        frame=read("origin_frame_name"),
        crop=CropBox((low[0], low[1], low[2]), (high[0], high[1], high[2])),
        arm_group=read("arm_group_name"),
        gripper_joint=read("~gripper_joint"),
        object_name=read("~object_name"),
        name_prefix=read("~name_prefix"),
        hand_id=read("manipulator_group_name"),
        torque=read("~torque_intensity"),
        max_grasps=read("~max_grasps"),
        max_checks=read("~max_checks"),
        check_reachability=read("~check_reachability"),
        scene_timeout_s=read("~scene_timeout"),
        seed=read("/seed"),
    )


def find_gripper_joint(settings: GeneratorSettings) -> str:
    """Returns the actuated joint of the gripper: the parameter, or else the only driven joint of the hand, with a log.

    Raises:
        GripperGeometryError: The parameter is not set, and the hand has several driven joints or none.
    """
    if settings.gripper_joint:
        return settings.gripper_joint
    parameter = rospy.resolve_name("~gripper_joint")
    descriptions = (str(rospy.get_param(f"robot_description{end}")) for end in ("", "_semantic"))
    try:
        joint = driven_joint(*descriptions, settings.hand_id)
    except GripperGeometryError as error:
        raise GripperGeometryError(f"parameter '{parameter}' is not set, and {error}; set the parameter") from error
    rospy.loginfo(
        "parameter '%s' is not set: joint '%s' moves the fingers, the only driven joint of the planning group '%s'",
        parameter, joint, settings.hand_id,
    )  # fmt: skip
    return joint


def read_hand_motion(read: ReadNumber) -> HandMotionSettings:
    """Returns the settings of the hand motion, which grasp methods share.

    Args:
        read: Function that reads a parameter.
    """
    return HandMotionSettings(
        approach_distance_m=read("~approach_distance"),
        lift_distance_m=read("~lift_distance"),
        finger_clearance_m=read("~finger_clearance"),
        min_finger_clearance_m=read("~min_finger_clearance"),
        tip_clearance_m=read("~tip_clearance"),
        min_pad_overlap_m=read("~min_pad_overlap"),
    )


def read_pair_grasps(cone_cosine: float, read: ReadNumber) -> PairGraspSettings:
    """Returns the settings of grasp methods that search pairs of contacts.

    Args:
        cone_cosine: Cosine of the half angle of the friction cone.
        read: Function that reads a parameter.
    """
    hand = HandSettings(
        **asdict(read_hand_motion(read)),
        approach_step_rad=read("~approach_step"),
        max_approach_angle_rad=read("~max_approach_angle"),
        cone_cosine=cone_cosine,
    )
    return PairGraspSettings(
        hand=hand,
        full_clearance_m=read("~full_clearance"),
        max_poses=int(read("~max_poses")),
        max_candidates=int(read("~max_candidates")),
    )


class ParameterisedMethod:
    """Base class of grasp methods that read their parameters again for every object.

    Attributes:
        declared_in: Package and node name; the parameters are declared in `parameters/NODE.yaml` of the package.

    Args:
        read: Function that reads a parameter; default: from the parameter server.
    """

    declared_in: tuple[str, str]

    def __init__(self, read: ReadNumber | None = None) -> None:
        """Stores the reader; parameters are read later."""
        self.read: ReadNumber = read or DeclaredParameters(*self.declared_in).value
