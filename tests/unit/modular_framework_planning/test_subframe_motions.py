# SPDX-License-Identifier: BSD-3-Clause
"""LIN and CIRC of a frame of a held object move this frame, and not the link that holds the object."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

pytest.importorskip("moveit_msgs.msg", reason="source the workspace: the messages are not built")

from geometry_msgs.msg import Point, Pose, Quaternion  # noqa: E402
from moveit_msgs.msg import (  # noqa: E402
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    OrientationConstraint,
    PositionConstraint,
)
from shape_msgs.msg import SolidPrimitive  # noqa: E402

from modular_framework_planning.errors import PlanningError  # noqa: E402
from modular_framework_planning.geometry.spatial import Transform  # noqa: E402
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool  # noqa: E402
from modular_framework_planning.messages.conversions import goals_from_constraints  # noqa: E402
from modular_framework_planning.messages.scene_conversions import apply_attached_object  # noqa: E402
from modular_framework_planning.planners.pilz.auxiliary_point import auxiliary_point  # noqa: E402
from modular_framework_planning.planners.pilz.command_planner import CommandPlanner  # noqa: E402
from modular_framework_planning.planning_interface.planning_request import (  # noqa: E402
    PipelineSettings,
    PlanningRequest,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline  # noqa: E402
from modular_framework_planning.planning_scene.planning_scene import PlanningScene, empty_scene  # noqa: E402
from modular_framework_planning.robot_model.robot_model import RobotModel  # noqa: E402
from modular_framework_planning.trajectory_processing.trajectory import Trajectory  # noqa: E402

GROUP, LINK, TIP = "arm_and_manipulator", "eg_manipulator", "tool/tip"
HOME = (1.57, -1.57, 1.2, -1.2, -1.57, 0.0)
LIMITS = {"max_trans_vel": 1.0, "max_trans_acc": 2.25, "max_trans_dec": -5.0, "max_rot_vel": 1.57}
SCALING = 0.1
TIP_IN_LINK = pin.SE3(pin.utils.rotate("x", 0.4), np.array([0.03, 0.05, 0.15]))


def message_of(pose: Transform) -> Pose:
    return Pose(Point(*pose.translation), Quaternion(*pin.Quaternion(pose.rotation).coeffs()))


@pytest.fixture(scope="module")
def scene(model: RobotModel) -> PlanningScene:
    """The arm holds a tool, whose tip is 0.16 m away from the link that holds it."""
    joints = model.group(GROUP).joints
    bare = empty_scene(model, model.merge(model.default_positions(), dict(zip(joints, HOME, strict=True))))
    tool = CollisionObject(id="tool", operation=CollisionObject.ADD, pose=message_of(pin.SE3.Identity()))
    tool.header.frame_id = LINK
    tool.primitives = [SolidPrimitive(SolidPrimitive.BOX, [0.01, 0.01, 0.01])]
    tool.primitive_poses = [message_of(pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2])))]
    tool.subframe_names, tool.subframe_poses = ["tip"], [message_of(TIP_IN_LINK)]
    return apply_attached_object(bare, AttachedCollisionObject(link_name=LINK, object=tool))


def asked(scene: PlanningScene, target: Transform, planner: str) -> PlanningRequest:
    """A request for a pose of the tip, as a client sends it."""
    frame = scene.model.planning_frame
    position, orientation = PositionConstraint(link_name=TIP), OrientationConstraint(link_name=TIP)
    position.header.frame_id = orientation.header.frame_id = frame
    position.constraint_region.primitives = [SolidPrimitive(SolidPrimitive.SPHERE, [1e-4])]
    position.constraint_region.primitive_poses = [Pose(Point(*target.translation), Quaternion(0.0, 0.0, 0.0, 1.0))]
    orientation.orientation = message_of(target).orientation
    for axis in "xyz":
        setattr(orientation, f"absolute_{axis}_axis_tolerance", 1e-3)
    message = Constraints(position_constraints=[position], orientation_constraints=[orientation])
    goals = goals_from_constraints(scene, [message], LINK)
    return PlanningRequest(
        scene,
        GROUP,
        goals,
        planner_id=planner,
        velocity_scaling=SCALING,
        acceleration_scaling=SCALING,
        allowed_time_s=600.0,
    )


def planned(request: PlanningRequest) -> Trajectory:
    pool = KinematicsPool(request.scene.model)
    return PlanningPipeline(pool, PipelineSettings(), CommandPlanner(LIMITS), adapters=()).plan(request).trajectory


def tips(scene: PlanningScene, motion: Trajectory) -> list[Transform]:
    """Poses of the tip at every millisecond."""
    model = scene.model
    joints = motion.joint_names
    return [
        model.link_transforms(model.merge(scene.positions, dict(zip(joints, row, strict=True))))[LINK] * TIP_IN_LINK
        for row in motion.sample(motion.sample_times())[0]
    ]


def test_lin_moves_the_tip_of_a_held_tool_on_a_line_within_the_cartesian_limits(scene: PlanningScene) -> None:
    start = scene.frame_transform(TIP)
    shift = np.array([0.15, 0.05, -0.1])
    target = pin.SE3(start.rotation @ pin.exp3(np.array([0.0, 0.2, 0.6])), start.translation + shift)
    motion = planned(asked(scene, target, "LIN"))
    poses = tips(scene, motion)
    assert np.allclose(poses[-1].homogeneous, target.homogeneous, atol=1e-5)
    ways = np.array([pose.translation - start.translation for pose in poses])
    line = shift / np.linalg.norm(shift)
    assert np.abs(ways - np.outer(ways @ line, line)).max() < 1e-4
    speeds = np.linalg.norm(np.diff(ways, axis=0), axis=1) / np.diff(motion.sample_times())[0]
    assert speeds.max() <= SCALING * LIMITS["max_trans_vel"] * 1.001


def test_circ_moves_the_tip_of_a_held_tool_through_the_interim_point(scene: PlanningScene) -> None:
    start = scene.frame_transform(TIP)
    target = pin.SE3(start.rotation, start.translation + np.array([0.1, 0.0, 0.0]))
    middle = start.translation + np.array([0.05, 0.0, -0.05])
    interim = Constraints(name="interim", position_constraints=[PositionConstraint(link_name=TIP)])
    interim.position_constraints[0].header.frame_id = scene.model.planning_frame
    interim.position_constraints[0].constraint_region.primitive_poses = [Pose(position=Point(*middle))]
    request = dataclasses.replace(asked(scene, target, "CIRC"), auxiliary_point=auxiliary_point(scene, interim))
    centre = start.translation + np.array([0.05, 0.0, 0.0])
    ways = np.array([pose.translation for pose in tips(scene, planned(request))])
    assert np.abs(np.linalg.norm(ways - centre, axis=1) - 0.05).max() < 1e-4
    assert np.linalg.norm(ways - middle, axis=1).min() < 1e-3
    interim.position_constraints[0].link_name = "tool/tap"
    with pytest.raises(PlanningError, match="'tool/tap'.*tool/tip"):
        auxiliary_point(scene, interim)
