# SPDX-License-Identifier: BSD-3-Clause
"""Request adapters that time a path: scaling, jerk, speed of a link, their parameters and what they refuse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.geometry.shapes import Box
from modular_framework_planning.kinematics.inverse_kinematics import KinematicsPool
from modular_framework_planning.planning_interface.planner_interface import PlannedPath, Planner, PlanningProblem
from modular_framework_planning.planning_interface.planning_request import (
    JointGoal,
    PipelineSettings,
    PlanningRequest,
    PlanningResult,
)
from modular_framework_planning.planning_pipeline.adapters.add_iterative_spline_parameterization import (
    AddIterativeSplineParameterization,
)
from modular_framework_planning.planning_pipeline.adapters.add_ruckig_trajectory_smoothing import (
    AddRuckigTrajectorySmoothing,
)
from modular_framework_planning.planning_pipeline.adapters.add_time_optimal_parameterization import (
    AddTimeOptimalParameterization,
)
from modular_framework_planning.planning_pipeline.adapters.add_time_parameterization import AddTimeParameterization
from modular_framework_planning.planning_pipeline.adapters.limit_max_cartesian_link_speed import (
    LimitMaxCartesianLinkSpeed,
)
from modular_framework_planning.planning_pipeline.adapters.request_adapter import RequestAdapter
from modular_framework_planning.planning_pipeline.pipeline import PlanningPipeline
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing.jerk_limits import (
    averaged_curve,
    slowed_to_limits,
)
from modular_framework_planning.trajectory_processing.time_parameterization import parameterize
from modular_framework_planning.trajectory_processing.trajectory import Trajectory

GROUP = "arm_and_manipulator"
START = (1.57, -1.57, 1.2, -1.2, -1.57, 0.0)
GOAL = (0.3, -1.2, 0.9, -1.5, -1.2, 0.5)
BETWEEN = ((1.57, -1.3, 0.8, -1.2, -1.57, 0.0), (0.8, -1.3, 0.8, -1.6, -1.3, 0.8))
JERK = 60.0


class OverTwoPoints(Planner):
    """A planner whose path goes over two given points."""

    def plan(self, problem: PlanningProblem) -> PlannedPath:
        return PlannedPath(np.array([START, *BETWEEN, GOAL]), keep_shape=True)


def start_scene(model: RobotModel) -> PlanningScene:
    """A scene with nothing in it but the robot at the start."""
    joints = dict(zip(model.group(GROUP).joints, START, strict=True))
    return empty_scene(model, model.merge(model.default_positions(), joints))


def planned(
    model: RobotModel,
    adapters: Sequence[RequestAdapter],
    parameters: dict[str, object] | None = None,
    planner: object = None,
    scene: PlanningScene | None = None,
    **request: object,
) -> PlanningResult:
    settings = PipelineSettings(
        parameters=parameters or {}, default_velocity_scaling_factor=0.1, default_acceleration_scaling_factor=0.2
    )
    pipeline = PlanningPipeline(KinematicsPool(model), settings, planner or OverTwoPoints(), adapters=adapters)
    joints = model.group(GROUP).joints
    return pipeline.plan(
        PlanningRequest(
            scene or start_scene(model),
            GROUP,
            (JointGoal(dict(zip(joints, GOAL, strict=True))),),
            # a slow motion is long to check on a busy machine
            **{"velocity_scaling": 1.0, "acceleration_scaling": 1.0, "allowed_time_s": 60.0, **request},
        )
    )


def largest(motion: Trajectory, order: int) -> np.ndarray:
    """Largest velocity (1), acceleration (2) or jerk (3) of each joint at 1 ms samples."""
    return np.abs(motion.sample(motion.sample_times(0.001))[order]).max(axis=0)


@pytest.mark.parametrize(
    "adapter", [AddTimeOptimalParameterization(), AddIterativeSplineParameterization(), AddTimeParameterization()]
)
def test_scaling_factors_scale_the_limits_and_0_means_the_default(model: RobotModel, adapter: RequestAdapter) -> None:
    indices = model.group(GROUP).indices
    for given, expected in (((0.5, 0.3), (0.5, 0.3)), ((0.0, 0.0), (0.1, 0.2)), ((1.0, 1.0), (1.0, 1.0))):
        motion = planned(model, [adapter], velocity_scaling=given[0], acceleration_scaling=given[1]).trajectory
        shares = (
            largest(motion, 1) / model.max_velocity[indices],
            largest(motion, 2) / model.max_acceleration[indices],
        )
        for share, factor in zip(shares, expected, strict=True):
            assert share.max() <= factor
        assert max(shares[0].max() / expected[0], shares[1].max() / expected[1]) > 0.98, "as fast as allowed"


@pytest.mark.parametrize("factor", [-0.1, 1.01])
def test_scaling_factors_out_of_range_are_1(model: RobotModel, factor: float, caplog: pytest.LogCaptureFixture) -> None:
    full, other = (
        planned(
            model, [AddTimeOptimalParameterization()], velocity_scaling=value, acceleration_scaling=value
        ).trajectory
        for value in (1.0, factor)
    )
    assert other.times.tolist() == full.times.tolist()
    assert f"max_velocity_scaling_factor is {factor:g}; it must be in (0, 1]" in caplog.text


@pytest.mark.parametrize("factor", [np.nan, np.inf])
def test_scaling_factors_that_are_no_numbers_are_refused(model: RobotModel, factor: float) -> None:
    for name in ("velocity_scaling", "acceleration_scaling"):
        with pytest.raises(PlanningError, match=r"must be in \(0, 1\]"):
            planned(model, [AddTimeOptimalParameterization()], **{name: factor})


def test_path_tolerance_and_resample_dt_are_honoured(model: RobotModel) -> None:
    wide, narrow = (
        planned(model, [AddTimeOptimalParameterization()], {"path_tolerance": value}).trajectory
        for value in (0.1, 0.005)
    )
    corner = np.array(BETWEEN[0])
    near = [float(np.linalg.norm(item.curve(0.002) - corner, axis=1).min()) for item in (wide, narrow)]
    assert near[0] > 0.02 and near[1] < 0.006
    fine = planned(model, [AddTimeOptimalParameterization()], {"resample_dt": 0.005}).trajectory
    assert np.diff(fine.times).max() < 0.0052 < np.diff(wide.times).max()
    for name in ("path_tolerance", "resample_dt"):
        with pytest.raises(PlanningError, match=f"parameter {name}"):
            planned(model, [AddTimeOptimalParameterization()], {name: -1.0})


@pytest.fixture()
def gentle(model: RobotModel, monkeypatch: pytest.MonkeyPatch) -> RobotModel:
    """The robot with limits of jerk."""
    monkeypatch.setattr(model, "max_jerk", np.full(len(model.joint_names), JERK))
    return model


def test_ruckig_smoothing_keeps_all_limits_and_the_ends(gentle: RobotModel) -> None:
    indices = gentle.group(GROUP).indices
    plain = planned(gentle, [AddTimeOptimalParameterization()]).trajectory
    assert largest(plain, 3).max() > 1.5 * JERK, "there is something to do"
    smooth = planned(gentle, [AddRuckigTrajectorySmoothing(), AddTimeOptimalParameterization()]).trajectory
    assert largest(smooth, 3).max() <= JERK
    assert (largest(smooth, 2) <= gentle.max_acceleration[indices]).all()
    assert (largest(smooth, 1) <= gentle.max_velocity[indices]).all()
    assert np.allclose(smooth.positions[[0, -1]], [START, GOAL]) and np.diff(smooth.times).min() > 0
    assert plain.duration_s < smooth.duration_s < plain.with_slowdown(2.0).duration_s


def test_smoothing_leaves_a_motion_within_the_limits_of_jerk_alone(model: RobotModel) -> None:
    plain = planned(model, [AddTimeOptimalParameterization()]).trajectory
    smooth = planned(model, [AddRuckigTrajectorySmoothing(), AddTimeOptimalParameterization()]).trajectory
    assert np.array_equal(plain.times, smooth.times)


def test_every_way_of_smoothing_keeps_the_limits_of_random_motions() -> None:
    rng = np.random.default_rng(6)
    velocity, acceleration = np.full(6, 3.0), np.full(6, 5.0)
    for _ in range(40):
        vertices = np.cumsum(rng.uniform(-1, 1, (rng.integers(2, 6), 6)), axis=0)
        jerk = np.full(6, rng.choice([5.0, 50.0, 500.0]))
        timed = parameterize(tuple("abcdef"), vertices, np.full(len(vertices) - 2, 0.1), velocity, acceleration)
        for motion in (
            averaged_curve(timed, velocity, acceleration, jerk),
            slowed_to_limits(timed, velocity, acceleration, jerk),
        ):
            assert (largest(motion, 1) <= velocity).all() and (largest(motion, 2) <= acceleration).all()
            assert (largest(motion, 3) <= jerk).all()
            assert np.diff(motion.times).min() > 1e-3
            assert np.allclose(motion.positions[[0, -1]], vertices[[0, -1]])


def speeds_by_difference(
    model: RobotModel, motion: Trajectory, link: str, point: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """Speed of a point of a link from its positions a tenth of a millisecond apart, at 1 ms samples."""
    times, step = motion.sample_times(0.001)[:-1], 1e-4
    data, frame = model.pin_model.createData(), model.frame_ids[link]

    def places(moments: np.ndarray) -> np.ndarray:
        result = []
        for values in motion.sample(moments)[0]:
            positions = model.merge(model.default_positions(), dict(zip(motion.joint_names, values, strict=True)))
            pin.framesForwardKinematics(model.pin_model, data, positions)
            result.append(data.oMf[frame].act(np.array(point)))
        return np.array(result)

    return np.linalg.norm(places(times + step) - places(times), axis=1) / step


@pytest.mark.parametrize("highest", [0.02, 0.2, 0.6])
def test_speed_of_the_link_stays_below_the_limit_and_near_it(model: RobotModel, highest: float) -> None:
    adapters = [LimitMaxCartesianLinkSpeed(), AddTimeOptimalParameterization()]
    indices = model.group(GROUP).indices
    plain = planned(model, adapters).trajectory
    assert speeds_by_difference(model, plain, "ezgripper_palm_link").max() > 0.7
    motion = planned(
        model, adapters, max_cartesian_speed=highest, cartesian_speed_limited_link="ezgripper_palm_link"
    ).trajectory
    speeds = speeds_by_difference(model, motion, "ezgripper_palm_link")
    assert speeds.max() <= highest
    assert np.quantile(speeds, 0.6) > 0.7 * highest, "only as slow as needed"
    shortest_s = speeds.sum() * 0.001 / highest
    assert motion.duration_s < 1.03 * shortest_s + 1.0, "speed is lost where the motion begins and ends only"
    assert (largest(motion, 1) <= model.max_velocity[indices]).all()
    assert (largest(motion, 2) <= model.max_acceleration[indices]).all()
    assert np.diff(motion.times).min() > 1e-3 and np.allclose(motion.positions[[0, -1]], [START, GOAL])


def test_speed_limit_of_the_tip_and_what_is_refused(model: RobotModel) -> None:
    adapters = [LimitMaxCartesianLinkSpeed(), AddTimeOptimalParameterization()]
    motion = planned(model, adapters, max_cartesian_speed=0.1).trajectory
    assert speeds_by_difference(model, motion, model.group(GROUP).tip_link).max() <= 0.1
    for request, code, text in (
        ({"max_cartesian_speed": -1.0}, ErrorCode.INVALID_MOTION_PLAN, "it must be above 0"),
        ({"max_cartesian_speed": float("nan")}, ErrorCode.INVALID_MOTION_PLAN, "it must be above 0"),
        (
            {"max_cartesian_speed": 1.0, "cartesian_speed_limited_link": "no_link"},
            ErrorCode.INVALID_LINK_NAME,
            "no_link",
        ),
    ):
        with pytest.raises(PlanningError, match=text) as caught:
            planned(model, adapters, **request)
        assert caught.value.code == code


@pytest.mark.parametrize(
    ("name", "point"), [("stick", (0.0, 0.1, 0.1)), ("stick/end", (0.0, 0.5, 0.1)), ("/stick/end", (0.0, 0.5, 0.1))]
)
def test_the_speed_limit_is_that_of_a_held_object_or_its_subframe(
    model: RobotModel, name: str, point: tuple[float, float, float]
) -> None:
    palm = "ezgripper_palm_link"
    turn = pin.SE3(pin.exp3(np.array([0.0, 0.0, np.pi / 2])), np.array([0.0, 0.1, 0.1]))
    stick = CollisionObject(
        "stick",
        turn,
        ((Box(0.02, 0.02, 0.02), pin.SE3.Identity()),),
        {"end": pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0]))},
    )
    held = start_scene(model).with_attached(AttachedObject(stick, palm, frozenset({palm})))
    adapters = [LimitMaxCartesianLinkSpeed(), AddTimeOptimalParameterization()]
    motion = planned(model, adapters, scene=held, max_cartesian_speed=0.2, cartesian_speed_limited_link=name).trajectory
    speeds = speeds_by_difference(model, motion, palm, point)
    assert speeds.max() <= 0.2
    assert np.quantile(speeds, 0.6) > 0.7 * 0.2, "only as slow as needed"
    with pytest.raises(PlanningError, match="cartesian_speed_limited_link 'stick/edn'.*did you mean 'stick/end'"):
        planned(model, adapters, scene=held, max_cartesian_speed=0.2, cartesian_speed_limited_link="stick/edn")


def nearest(motion: Trajectory, values: np.ndarray) -> np.ndarray:
    """The state of a motion that is nearest to a joint vector."""
    curve = motion.curve(0.002)
    return curve[np.argmin(np.linalg.norm(curve - values, axis=1))]


def test_a_trajectory_of_the_planner_is_slowed_too_but_not_timed_anew(model: RobotModel) -> None:
    names = model.group(GROUP).joints

    class Timed(Planner):
        def plan(self, problem: PlanningProblem) -> Trajectory:
            return parameterize(
                names, np.array([START, GOAL]), np.zeros(0), problem.max_velocity, problem.max_acceleration
            )

    adapters = [LimitMaxCartesianLinkSpeed(), AddTimeOptimalParameterization()]
    plain = planned(model, adapters, planner=Timed()).trajectory
    slow = planned(model, adapters, planner=Timed(), max_cartesian_speed=0.05).trajectory
    assert np.allclose(slow.sample(slow.times[::7])[0], [nearest(plain, row) for row in slow.positions[::7]], atol=2e-3)
    assert slow.duration_s > 3.0 * plain.duration_s
