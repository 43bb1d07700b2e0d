# SPDX-License-Identifier: BSD-3-Clause
"""Conformance suite of planners, with what clients of move_group require of every planner.

To use the suite, define in a test module a subclass of `PlannerConformance` whose name starts with Test and set
`plugin`. The suite plans for a planar arm with three joints. A second collision checker judges the motions.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
)
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_pipeline.pipeline_spec import PipelineSpec
from modular_framework_planning.planning_pipeline.plugins import DEFAULT_ADAPTERS
from modular_framework_planning.planning_scene.planning_scene import CollisionObject, empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_testing.planning.independent_checker import IndependentChecker
from modular_framework_testing.planning.independent_checker import box as solid_box

GROUP, JOINTS = "arm", ("joint_1", "joint_2", "joint_3")
LINK_M, THICKNESS_M = 0.3, 0.04
MAX_VELOCITY, MAX_ACCELERATION = 2.0, 5.0
"""Limits of each joint [rad/s], [rad/s^2]."""
START, GOAL = (-1.2, 0.3, 0.3), (1.2, -0.3, -0.3)
WALL_SIZE_M, WALL_XYZ_M = (0.1, 0.1, 0.3), (0.75, 0.0, 0.0)
"""Box that the stretched arm touches at joint_1 = 0, and that the folded arm passes."""
SLAB_SIZE_M, SLAB_XYZ_M = (2.0, 0.02, 0.3), (1.12, 0.0, 0.0)
"""Wall that no posture of the arm passes on its way from START to GOAL within the joint ranges."""
REACTION_S = 1.0
"""Maximum time from the cancellation, or from the end of the allowed time, to the answer [s]."""
SAMPLE_S = 0.001


def _link(number: int) -> str:
    shape = f"<origin xyz='{LINK_M / 2} 0 0'/><geometry><box size='{LINK_M} {THICKNESS_M} {THICKNESS_M}'/></geometry>"
    return f"<link name='link_{number}'><collision>{shape}</collision></link>"


def _joint(number: int) -> str:
    parent, x = (f"link_{number - 1}", LINK_M) if number > 1 else ("base", 0.0)
    return (
        f"<joint name='joint_{number}' type='revolute'><parent link='{parent}'/><child link='link_{number}'/>"
        f"<origin xyz='{x} 0 0'/><axis xyz='0 0 1'/>"
        f"<limit lower='-2.5' upper='2.5' velocity='{MAX_VELOCITY}' effort='10'/></joint>"
    )


URDF = "<robot name='planar_arm'><link name='base'/>" + "".join(_link(n) + _joint(n) for n in (1, 2, 3)) + "</robot>"
SRDF = (
    "<robot name='planar_arm'><group name='arm'><chain base_link='base' tip_link='link_3'/></group>"
    "<disable_collisions link1='link_1' link2='link_2' reason='Adjacent'/>"
    "<disable_collisions link1='link_2' link2='link_3' reason='Adjacent'/></robot>"
)
LIMITS = {
    "joint_limits": {name: {"has_acceleration_limits": True, "max_acceleration": MAX_ACCELERATION} for name in JOINTS}
}


class PlannerConformance:
    """Tests of one planner.

    Attributes:
        plugin: Name of the planner as in the parameter `planning_plugin`, such as `my_planners/OneStop`.
        planner_id: Name in requests; empty for the default planner.
        parameters: Parameters of the pipeline.
        adapters: Request adapters; empty for a planner that returns timed trajectories.
        avoids_obstacles: Whether the planner finds a way around an obstacle. If False, an error is also correct.
    """

    plugin: str
    planner_id: str = ""
    parameters: Mapping[str, Any] = {}
    adapters: str = DEFAULT_ADAPTERS
    avoids_obstacles: bool = True

    def setup_method(self) -> None:
        """Runs before each test."""
        self.model = RobotModel(URDF, SRDF, LIMITS)
        self._pipelines: list[PlanningPipeline] = []

    def teardown_method(self) -> None:
        """Runs after each test: ends the planner's own processes."""
        for pipeline in self._pipelines:
            pipeline.close()

    def test_a_free_motion_joins_start_and_goal_within_the_limits(self) -> None:
        """The motion begins at the start, ends at the goal, and keeps velocities and accelerations."""
        self._check(self._pipeline().plan(self._request()), boxes=())

    def test_a_motion_avoids_an_obstacle_or_the_error_has_a_reason(self) -> None:
        """The straight line collides, so that the planner needs a detour, or says that it has none."""
        wall = ("wall", WALL_SIZE_M, WALL_XYZ_M)
        try:
            result = self._pipeline().plan(self._request(wall))
        except PlanningError as error:
            assert not self.avoids_obstacles, error.reason
            assert error.reason
        else:
            self._check(result, boxes=(wall,))

    def test_a_goal_in_collision_is_an_error_that_names_the_bodies(self) -> None:
        """The error names the link and the object."""
        error = self._error(self._request(("post", (0.1, 0.1, 0.3), self._middle_of_last_link(GOAL))))
        assert "post" in error.reason, error.reason
        assert "link_3" in error.reason, error.reason

    def test_without_a_path_the_planner_ends_in_time(self) -> None:
        """An endless wall separates start and goal."""
        begin_s = time.monotonic()
        error = self._error(self._request(("slab", SLAB_SIZE_M, SLAB_XYZ_M), allowed_time_s=2.0))
        assert error.reason
        assert time.monotonic() - begin_s < 2.0 + REACTION_S, error.reason

    def test_a_cancelled_request_ends_at_once(self) -> None:
        """The client cancels while the planner searches for a path that does not exist."""
        cancelled = threading.Event()
        request = self._request(("slab", SLAB_SIZE_M, SLAB_XYZ_M), allowed_time_s=30.0, cancelled=cancelled.is_set)
        threading.Timer(0.3, cancelled.set).start()
        begin_s = time.monotonic()
        error = self._error(request)
        assert time.monotonic() - begin_s < 0.3 + REACTION_S, error.reason

    def test_concurrent_requests_get_their_own_motions(self) -> None:
        """One planner serves several threads, each with another start."""
        pipeline, results = self._pipeline(), dict[float, PlanningResult]()

        def plan(offset: float) -> None:
            results[offset] = pipeline.plan(self._request(offset=offset))

        threads = [threading.Thread(target=plan, args=(0.1 * number,)) for number in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(results) == len(threads)
        for offset, result in results.items():
            self._check(result, boxes=(), offset=offset)

    def _pipeline(self) -> PlanningPipeline:
        settings = PipelineSettings(parameters=dict(self.parameters), robot_planning=_ROBOT_PLANNING)
        spec = PipelineSpec("tested", self.plugin, self.adapters, settings)
        self._pipelines.append(spec.build(self.model, KinematicsPool(self.model)))
        return self._pipelines[-1]

    def _request(
        self,
        obstacle: tuple[str, tuple[float, ...], tuple[float, ...]] | None = None,
        offset: float = 0.0,
        **changes: Any,
    ) -> PlanningRequest:
        scene = empty_scene(self.model, self._positions(START, offset))
        if obstacle is not None:
            name, size, xyz = obstacle
            pose = pin.SE3(np.eye(3), np.array(xyz))
            scene = scene.with_object(CollisionObject(name, pose, ((Box(*size), pin.SE3.Identity()),)))
        arguments: dict[str, Any] = {
            "planner_id": self.planner_id,
            "allowed_time_s": 20.0,
            "velocity_scaling": 1.0,
            "acceleration_scaling": 1.0,
            **changes,
        }
        return PlanningRequest(scene, GROUP, (JointGoal(dict(zip(JOINTS, GOAL, strict=True))),), **arguments)

    def _positions(self, values: tuple[float, ...], offset: float = 0.0) -> np.ndarray:
        named = dict(zip(JOINTS, (value + offset for value in values), strict=True))
        return self.model.merge(self.model.default_positions(), named)

    def _middle_of_last_link(self, values: tuple[float, ...]) -> tuple[float, ...]:
        angles = np.cumsum(values)
        lengths = LINK_M * np.array([1.0, 1.0, 0.5])
        return float(lengths @ np.cos(angles)), float(lengths @ np.sin(angles)), 0.0

    def _error(self, request: PlanningRequest) -> PlanningError:
        try:
            result = self._pipeline().plan(request)
        except PlanningError as error:
            return error
        raise AssertionError(f"there is no path, and the planner returned one of {len(result.path)} vertices")

    def _check(
        self,
        result: PlanningResult,
        boxes: tuple[tuple[str, tuple[float, ...], tuple[float, ...]], ...],
        offset: float = 0.0,
    ) -> None:
        """Checks ends, limits and collisions of a motion at samples 1 ms apart."""
        motion = result.trajectory
        assert (np.diff(motion.times) > 0.0).all(), "times must increase strictly"
        positions, velocities, accelerations, _ = motion.sample(motion.sample_times(SAMPLE_S))
        assert tuple(motion.joint_names) == JOINTS
        np.testing.assert_allclose(positions[0], np.array(START) + offset, atol=1e-9)
        np.testing.assert_allclose(positions[-1], GOAL, atol=1e-6)
        assert np.abs(velocities).max() <= MAX_VELOCITY * (1.0 + 1e-6)
        assert np.abs(accelerations).max() <= MAX_ACCELERATION * (1.0 + 1e-6)
        checker = IndependentChecker(URDF, SRDF, str)
        checker.set_world((name, solid_box(*size), _translation(xyz)) for name, size, xyz in boxes)
        assert not checker.colliding_states(motion.joint_names, positions, {}), "the motion collides"


_ROBOT_PLANNING = {
    "cartesian_limits": {"max_trans_vel": 1.0, "max_trans_acc": 2.0, "max_trans_dec": -2.0, "max_rot_vel": math.pi}
}


def _translation(xyz: tuple[float, ...]) -> np.ndarray:
    """Returns a homogeneous transform, shape (4, 4)."""
    result = np.eye(4)
    result[:3, 3] = xyz
    return result
