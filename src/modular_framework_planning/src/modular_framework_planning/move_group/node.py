# SPDX-License-Identifier: BSD-3-Clause
"""The move_group node: loads the robot, then advertises the endpoints once they are ready."""

from __future__ import annotations

import sys
import time

import rospy

from modular_framework_planning.errors import ModelError, PlanningError
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.move_group.capabilities.cartesian_path_service import CartesianPathService
from modular_framework_planning.move_group.capabilities.execute_trajectory_action import ExecuteTrajectory
from modular_framework_planning.move_group.capabilities.kinematics_service import KinematicsService
from modular_framework_planning.move_group.capabilities.move_action import MoveAction
from modular_framework_planning.move_group.capabilities.pickup_action import PickupAction
from modular_framework_planning.move_group.capabilities.place_action import PlaceAction
from modular_framework_planning.move_group.capabilities.plan_service import PlanService
from modular_framework_planning.move_group.capabilities.planning_scene_services import (
    ApplyPlanningSceneService,
    ClearOctomapService,
    GetPlanningSceneService,
)
from modular_framework_planning.move_group.capabilities.query_planners_service import QueryPlannersService
from modular_framework_planning.move_group.capabilities.sequence_action import SequenceAction
from modular_framework_planning.move_group.capabilities.sequence_service import SequenceService
from modular_framework_planning.move_group.capabilities.state_validation_service import StateValidationService
from modular_framework_planning.move_group.capabilities.tf_publisher import TfPublisher
from modular_framework_planning.move_group.capability_selection import Capability, chosen_capabilities
from modular_framework_planning.move_group.context import MoveGroupContext
from modular_framework_planning.move_group.controllers.execution import load_execution
from modular_framework_planning.move_group.description_topics import publish_descriptions
from modular_framework_planning.move_group.markers.scene_markers import MarkerPublisher
from modular_framework_planning.move_group.monitors.octomap_monitor import OctomapMonitor
from modular_framework_planning.move_group.monitors.scene_monitor import SceneMonitor
from modular_framework_planning.move_group.node_parameters import settings_below
from modular_framework_planning.move_group.node_settings import (
    MotionSettings,
    PlanExecutionSettings,
    SceneMonitorSettings,
)
from modular_framework_planning.move_group.padding_parameters import load_padding
from modular_framework_planning.move_group.pipeline_parameters import load_pipelines
from modular_framework_planning.move_group.planning_report import Reporter
from modular_framework_planning.move_group.reconfiguration import reconfigurations
from modular_framework_planning.move_group.robot_parameters import (
    collision_detector_name,
    ignored_parameters,
    load_kinematics_settings,
    load_robot_model,
)
from modular_framework_planning.numba_cache import cache_is_empty
from modular_framework_planning.pick_place.settings import PickPlaceSettings
from modular_framework_planning.planning_interface.collision_detectors import collision_detector
from modular_framework_planning.planning_interface.planning_request import SamplingSettings
from modular_framework_planning.process_setup.compile_loops import compile_all
from modular_framework_planning.process_setup.garbage_collection import freeze_loaded_objects
from modular_framework_planning.process_setup.many_threads import prepare

# Endpoints, by the names that MoveIt's parameters `capabilities` and `disable_capabilities` use
CAPABILITIES = (
    Capability("move_group/MoveGroupPlanService", PlanService),
    Capability("move_group/MoveGroupCartesianPathService", CartesianPathService),
    Capability("move_group/MoveGroupKinematicsService", KinematicsService),
    Capability("move_group/MoveGroupStateValidationService", StateValidationService),
    Capability("move_group/MoveGroupGetPlanningSceneService", GetPlanningSceneService),
    Capability("move_group/ApplyPlanningSceneService", ApplyPlanningSceneService),
    Capability("move_group/ClearOctomapService", ClearOctomapService),
    Capability("move_group/MoveGroupQueryPlannersService", QueryPlannersService),
    Capability("move_group/MoveGroupMoveAction", MoveAction),
    Capability("move_group/MoveGroupExecuteTrajectoryAction", ExecuteTrajectory),
    Capability("move_group/MoveGroupPickPlaceAction", PickupAction),
    Capability("move_group/MoveGroupPickPlaceAction", PlaceAction),
    Capability("pilz_industrial_motion_planner/MoveGroupSequenceAction", SequenceAction, default=False),
    Capability("pilz_industrial_motion_planner/MoveGroupSequenceService", SequenceService, default=False),
    Capability("move_group/TfPublisher", TfPublisher, default=False),
)


def build_context() -> MoveGroupContext:
    """Builds the context of all endpoints; raises PlanningError for a missing or invalid parameter."""
    model = load_robot_model()
    kinematics = KinematicsPool(model, load_kinematics_settings())
    monitor = SceneMonitor(model, load_padding(model), settings_below("planning_scene_monitor", SceneMonitorSettings))
    for warning in ignored_parameters():
        rospy.logwarn("%s", warning)
    execution = load_execution(monitor)
    detector = collision_detector_name()
    new_checker = collision_detector(detector)
    pipelines = load_pipelines(model, kinematics, detector)
    pipelines.sampling_settings = settings_below("ompl", SamplingSettings)
    settings = MotionSettings(
        settings_below("plan_execution", PlanExecutionSettings), settings_below("pick_place", PickPlaceSettings)
    )
    return MoveGroupContext(
        model=model,
        monitor=monitor,
        kinematics=kinematics,
        pipelines=pipelines,
        execution=execution,
        markers=MarkerPublisher(model.planning_frame),
        reporter=Reporter(publish_requests="--debug" in rospy.myargv()),
        settings=settings,
        new_checker=new_checker,
    )


def advertise(context: MoveGroupContext) -> None:
    """Connects the monitors, the markers, the execution and all enabled endpoints."""
    context.monitor.listeners.append(context.markers.show_scene)
    context.monitor.connect()
    OctomapMonitor(context.monitor).connect()
    context.markers.show_scene(context.monitor.snapshot())
    publish_descriptions()
    context.execution.connect()
    for reconfiguration in reconfigurations(context):
        reconfiguration.connect()
    rospy.on_shutdown(context.execution.close)
    rospy.on_shutdown(context.pipelines.close)
    for capability in chosen_capabilities(CAPABILITIES):
        capability(context).connect()


def warm_up(context: MoveGroupContext) -> None:
    """Compiles missing kernels, and runs one collision check so that the checker builds its link geometry.

    Raises:
        PlanningError: The checker cannot check the scene or has no attribute `model`.
    """
    if cache_is_empty():
        rospy.logwarn("compiling the planner's kernels; this takes some minutes (./install.sh compiles in advance)")
        compile_all()
    scene = context.monitor.snapshot()
    checker = context.new_checker(scene)
    if not hasattr(checker, "model"):
        raise ModelError(f"collision_detector: {type(checker).__name__} lacks the attribute model (RobotModel); add it")
    checker.is_free(scene.positions)
    checker.distance(scene.positions)
    freeze_loaded_objects()


def load_remaining_kernels() -> None:
    """Loads all remaining compiled kernels."""
    compile_all()
    freeze_loaded_objects()


def main() -> int:
    """Runs the node and returns the exit code."""
    start = time.monotonic()
    prepare()
    rospy.init_node("move_group")
    try:
        context = build_context()
        warm_up(context)
    except PlanningError as error:
        rospy.logfatal("move_group cannot start: %s", error.reason)
        return 1
    advertise(context)
    rospy.loginfo(
        "move_group is ready: robot '%s', groups %s, pipelines %s (default %s), %s, after %.1f s",
        context.model.name,
        ", ".join(context.model.groups),
        ", ".join(context.pipelines),
        context.default_pipeline,
        context.execution.describe(),
        time.monotonic() - start,
    )
    load_remaining_kernels()
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
