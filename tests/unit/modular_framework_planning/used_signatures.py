# SPDX-License-Identifier: BSD-3-Clause
"""Prints which compiled loops the product calls with argument types that compile_all() did not compile.

Run as a program: a loop that an earlier test has called would hide that compile_all() leaves it out. Reads the URDF and
the SRDF of the shipped robot as a JSON list from standard input.
"""

from __future__ import annotations

import json
import sys

import numpy as np
import pinocchio as pin
from numba.core.dispatcher import Dispatcher

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.constraints.constraint_kinds import FrameOnRobot, OrientationConstraint
from modular_framework_planning.constraints.kinematic_constraints import KinematicConstraints
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.octomap.encoding import read_stream, write_binary, write_full
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.octomap.voxel_map import empty_map
from modular_framework_planning.perception.self_filter import RegionCache, bodies_in_scene, self_filter_of
from modular_framework_planning.planners.ompl.planner import OmplPlanner
from modular_framework_planning.planners.stomp.planner import StompPlanner
from modular_framework_planning.planning_interface.planning_request import PipelineSettings, PlanningRequest, PoseGoal
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.plugins import make_adapters
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.process_setup.compile_loops import compile_all
from modular_framework_planning.robot_model.robot_model import RobotModel

GROUP = "arm_and_manipulator"
START = (0.9, -1.57, 1.2, -1.2, -1.57, 0.0)


def loops() -> dict[str, Dispatcher]:
    """Every compiled loop of the modules loaded by now."""
    return {
        f"{module}.{name}": value
        for module in sorted(sys.modules)
        if module.split(".")[-1].startswith("compiled_")
        for name, value in vars(sys.modules[module]).items()
        if isinstance(value, Dispatcher)
    }


def signatures() -> set[tuple[str, str]]:
    """Loops with the argument types they were called with."""
    return {(name, str(types)) for name, loop in loops().items() for types in loop.signatures}


def held(name: str, link: str) -> AttachedObject:
    """A small box in the hand."""
    body = CollisionObject(name, pin.SE3.Identity(), ((Box(0.02, 0.02, 0.02), pin.SE3.Identity()),))
    return AttachedObject(body, link, frozenset((link,)))


def upright(scene: PlanningScene, link: str) -> KinematicConstraints:
    """The link keeps its tilt."""
    model = scene.model
    frame, pose = model.pin_model.frames[model.frame_ids[link]], model.link_transforms(scene.positions)[link]
    turn = OrientationConstraint(
        FrameOnRobot(link, frame.parentJoint, frame.placement),
        FrameOnRobot(model.planning_frame, 0, pin.SE3.Identity()),
        pose.rotation,
        np.array([0.2, 0.2, 7.0]),
    )
    return KinematicConstraints(model, orientations=[turn])


def use(model: RobotModel) -> None:
    """Maps, solves, plans in two ways, with and without path constraints, and asks for contacts."""
    far = np.array([[2.0, 0.3, 0.5], [2.0, 0.4, 0.5]])
    voxels = empty_map(0.05).with_point_cloud(np.array([0.0, 0.0, 1.0]), far, far[:0], far + 1.0)
    voxels = read_stream(write_full(voxels), 0.05, False).with_free_cells(voxels.keys[:1])
    read_stream(write_binary(voxels), 0.05, True)
    group = model.group(GROUP)
    positions = model.merge(model.default_positions(), dict(zip(group.joints, START, strict=True)))
    scene = empty_scene(model, positions).with_octomap(Octree(voxels), pin.SE3.Identity())
    scene = scene.with_attached(held("held", group.tip_link))
    self_filter_of(RegionCache(), bodies_in_scene(scene, positions), 1.0, 0.02).hides(far, np.zeros(3), 0.1)
    goal = model.link_transforms(model.merge(positions, {group.joints[0]: -0.9}))[group.tip_link]
    kinematics = KinematicsPool(model)
    settings = PipelineSettings(seed=1, parameters={"num_iterations": 5})
    for planner in (OmplPlanner(), StompPlanner.configure(model, settings)):
        pipeline = PlanningPipeline(kinematics, settings, planner, adapters=make_adapters())
        for constraints in (None, upright(scene, group.tip_link)):
            request = PlanningRequest(
                scene, GROUP, (PoseGoal(group.tip_link, goal),), allowed_time_s=60.0, path_constraints=constraints
            )
            pipeline.plan(request)
    ExactCollisionChecker(scene).contacts(positions)


def main() -> None:
    """Compares the argument types before and after."""
    model = RobotModel(*json.load(sys.stdin))
    compile_all()
    compiled = signatures()
    use(model)
    json.dump(sorted(signatures() - compiled), sys.stdout)


if __name__ == "__main__":
    main()
