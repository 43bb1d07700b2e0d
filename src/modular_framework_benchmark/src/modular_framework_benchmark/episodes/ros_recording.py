# SPDX-License-Identifier: BSD-3-Clause
"""Writes the recording of an episode: trajectories, the record of the world, and the reports of components."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import rosgraph
import rospy
from numpy.typing import NDArray

from modular_framework_benchmark.episodes.ros_samples import Samples
from modular_framework_benchmark.metrics.recording_files import (
    PARAMETERS,
    RECORDING,
    TRACKING,
    TRAJECTORY,
    WORLD_RECORD,
)
from modular_framework_benchmark.predicates.world_track import read_world
from modular_framework_benchmark.records.episode_settings import PlacedObject
from modular_framework_ros.reported_figures import (
    ATTEMPTS,
    CLEARANCE,
    CONCURRENT,
    ERROR_CODE,
    PLANNER_FAULT,
    PLANNER_METHOD_TIME,
    PLANNER_QUEUE_TIME,
    PLANNER_TRANSPORT_TIME,
    PLANNING_TIME,
    PROCESSOR_TIME,
)

VARYING_PARAMETERS = ("run_id", "roslaunch", "seed")
"""Parameters that differ between episodes of the same configuration."""

PLAN_FIGURES = (
    ATTEMPTS,
    CLEARANCE,
    ERROR_CODE,
    PLANNER_FAULT,
    PLANNER_METHOD_TIME,
    PLANNER_QUEUE_TIME,
    PLANNER_TRANSPORT_TIME,
    PROCESSOR_TIME,
)
"""Figures in the reports of move_group, by name."""

TIME_TOLERANCE_S = 1e-6
POSE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def write_recording(
    folder: Path,
    samples: Samples,
    world: Mapping[str, Any],
    *,
    spawned: Sequence[PlacedObject],
    answer: Mapping[str, Any],
    rate_hz: float | None,
) -> dict[str, Any]:
    """Writes the files of an episode.

    Args:
        folder: Folder of the files.
        samples: Collected messages.
        world: Record of the world by the simulation.
        spawned: Spawned objects.
        answer: `origin_s`: ROS time at the start of the recording [s]; `checked_s`, `simulated_s`: time of the success
            check and of the end [s since the start of the recording].
        rate_hz: Publish rate of the joint states while simulated time passes [Hz]; None to keep all messages, see
            `periodic_joint_states`.

    Returns:
        `final`: pose of each object at the success check;
        `recording_fault`: description of missing samples, "" if complete.
    """
    origin_s, end_s = float(answer["zero"]), float(answer.get("simulated_s", np.inf))
    (folder / WORLD_RECORD).write_text(json.dumps(world))
    poses = _object_poses(world, origin_s)
    tracking = _within_episode(_tracking(samples, origin_s), end_s)
    joints = samples.joints if rate_hz is None else periodic_joint_states(samples.joints, rate_hz)
    trajectory = _with_objects(
        _within_episode(_trajectory(joints, commands_of(tracking, samples.set_points, origin_s), origin_s), end_s),
        poses,
    )
    trajectory.to_parquet(folder / TRAJECTORY)
    tracking.to_parquet(folder / TRACKING)
    content = {
        "origin_s": origin_s,
        "objects": {name: rows.to_dict("list") for name, rows in poses.items()},
        "spawned": {placed.name: placed.model for placed in spawned},
        "scales": {placed.name: placed.scale for placed in spawned if placed.scale is not None},
        "reports": [*_planning(samples, origin_s), *_actions(samples, origin_s), *_components(samples, origin_s)],
    }
    (folder / RECORDING).write_text(json.dumps(content))
    checked_s = float(answer.get("checked_s", np.inf))
    final = {name: _pose_at(rows, checked_s) for name, rows in poses.items() if len(rows)}
    missing = 0 if rate_hz is None else count_missing_samples(trajectory["time_s"].to_numpy() + origin_s, rate_hz)
    faults = [f"{missing} of {len(trajectory) + missing} joint states did not arrive"] if missing else []
    return {"final": final, "recording_fault": "; ".join(faults)}


def write_parameters(folder: Path) -> tuple[dict[str, Any], str]:
    """Writes all parameters of the parameter server; returns the parameters and their SHA-256 in hexadecimal.

    Args:
        folder: Folder of `parameters.json`.
    """
    # rospy's cache may hold only part of the parameters.
    parameters = rosgraph.Master(rospy.get_name()).getParam("/")
    text = json.dumps(parameters, sort_keys=True, indent=1)
    (folder / PARAMETERS).write_text(text)
    constant = {name: value for name, value in parameters.items() if name not in VARYING_PARAMETERS}
    return parameters, hashlib.sha256(json.dumps(constant, sort_keys=True).encode()).hexdigest()


def _within_episode(rows: pd.DataFrame, end_s: float) -> pd.DataFrame:
    """Returns the samples between the reset of the world at the start of an episode and the end."""
    return rows[(rows["time_s"] > TIME_TOLERANCE_S) & (rows["time_s"] < end_s + TIME_TOLERANCE_S)].reset_index(
        drop=True
    )


def _pose_at(rows: pd.DataFrame, time_s: float) -> list[float]:
    """Returns the pose of the last sample up to a time, or of the first sample."""
    row = max(int(np.searchsorted(rows["time_s"].to_numpy(), time_s, side="right")) - 1, 0)
    return [float(rows[column].iloc[row]) for column in POSE_COLUMNS]


def _object_poses(world: Mapping[str, Any], origin_s: float) -> dict[str, pd.DataFrame]:
    """Returns the poses of all models by name; a model at rest has one row."""
    track = read_world(world, origin_s, -np.inf, np.inf)
    frames = {}
    for name, body in track.bodies.items():
        rows = np.column_stack([track.times_s, body.positions, body.quaternions])
        frame = pd.DataFrame(rows, columns=["time_s", *POSE_COLUMNS]).dropna()
        frames[name] = frame if len(frame[list(POSE_COLUMNS)].drop_duplicates()) > 1 else frame.iloc[[0]]
    return frames


def _tracking(samples: Samples, origin_s: float) -> pd.DataFrame:
    """Returns a row per joint and message: time_s, controller, joint, desired, actual."""
    rows = [
        (message.header.stamp.to_sec() - origin_s, name, joint, desired, actual)
        for name, message in samples.controllers
        for joint, desired, actual in zip(
            message.joint_names, message.desired.positions, message.actual.positions, strict=False
        )
    ]
    return pd.DataFrame(rows, columns=["time_s", "controller", "joint", "desired", "actual"])


def periodic_joint_states(messages: Sequence[Any], rate_hz: float) -> list[Any]:
    """Returns the joint states at a fixed rate, without states published while time was held.

    A simulation also publishes its state while time is held. Whether time is held between two requests to advance
    depends on the load of the machine, so these states would differ from run to run.

    Args:
        messages: sensor_msgs/JointState messages in the order of their stamps.
        rate_hz: Publish rate [Hz]; the first period starts at time 0.
    """
    first_messages: dict[tuple[int, tuple[str, ...]], Any] = {}
    for message in messages:
        period = int(_period_indices(message.header.stamp.to_sec(), rate_hz))
        first_messages.setdefault((period, tuple(message.name)), message)
    return list(first_messages.values())


def count_missing_samples(times_s: NDArray[np.float64], rate_hz: float) -> int:
    """Returns the number of sampling periods without a sample, between the first and the last sample.

    Args:
        times_s: Ascending times [s], at most one per period.
        rate_hz: Sampling rate [Hz].
    """
    periods = _period_indices(times_s, rate_hz)
    return int(periods[-1] - periods[0]) + 1 - len(periods) if len(periods) else 0


def _period_indices(times_s: Any, rate_hz: float) -> Any:
    return np.floor(times_s * rate_hz + TIME_TOLERANCE_S)


def commands_of(tracking: pd.DataFrame, set_points: Sequence[tuple[str, Any]], origin_s: float) -> pd.DataFrame:
    """Returns the commands of the controllers: time_s, joint, desired.

    Args:
        tracking: Samples of the trajectory controllers.
        set_points: Joint and control_msgs/JointControllerState of single-joint controllers. The stamps of clients'
            goals are not used, because they depend on the latency of the clock topic.
        origin_s: ROS time at the start of the recording [s].
    """
    rows = [(state.header.stamp.to_sec() - origin_s, joint, state.set_point) for joint, state in set_points]
    columns = ["time_s", "joint", "desired"]
    return pd.concat([tracking[columns], pd.DataFrame(rows, columns=columns)]) if rows else tracking[columns]


def _trajectory(joints: Sequence[Any], commands: pd.DataFrame, origin_s: float) -> pd.DataFrame:
    """Returns a row per time: `time_s`, and position, velocity, effort and command of each joint."""
    rows: dict[float, dict[str, float]] = {}
    for message in joints:
        row = rows.setdefault(message.header.stamp.to_sec() - origin_s, {})
        for kind, values in (
            ("position", message.position),
            ("velocity", message.velocity),
            ("effort", message.effort),
        ):
            row.update((f"{joint}/{kind}", value) for joint, value in zip(message.name, values, strict=False))
    frame = pd.DataFrame.from_dict(rows, orient="index").sort_index()
    frame.insert(0, "time_s", frame.index.to_numpy(dtype=float))
    frame = frame.reset_index(drop=True)
    for joint, joint_commands in commands.sort_values("time_s").groupby("joint"):
        last = np.searchsorted(joint_commands["time_s"].to_numpy(), frame["time_s"].to_numpy(), side="right") - 1
        values = joint_commands["desired"].to_numpy()
        frame[f"{joint}/command"] = np.where(last >= 0, values[np.maximum(last, 0)], np.nan)
    return frame


def _with_objects(trajectory: pd.DataFrame, poses: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Adds the pose of each moving object from its latest sample."""
    columns = {}
    for name, rows in poses.items():
        if len(rows) < 2 or not len(trajectory):
            continue
        indices = np.searchsorted(rows["time_s"].to_numpy(), trajectory["time_s"].to_numpy(), side="right") - 1
        for column in POSE_COLUMNS:
            columns[f"{name}/{column}"] = rows[column].to_numpy()[np.maximum(indices, 0)]
    return pd.concat([trajectory, pd.DataFrame(columns, index=trajectory.index)], axis=1)


def _motion(trajectory: Any) -> dict[str, Any] | None:
    points = trajectory.points
    if not points:
        return None
    return {
        "joints": list(trajectory.joint_names),
        "times_s": [point.time_from_start.to_sec() for point in points],
        "positions": [list(point.positions) for point in points],
    }


def _planning(samples: Samples, origin_s: float) -> list[dict[str, Any]]:
    """Returns the reports of plans, each with the displayed motion that matches its start and goal."""
    unmatched = [path for path in samples.paths if path.trajectory]
    reports = []
    plans = [entry for entry in samples.planning if _is_plan(entry[1])]
    spans = [(wall - float(report.get("planning_time_s") or 0.0), wall) for wall, report in plans]
    for wall, report in plans:
        activity = {
            "component": "planning",
            "name": str(report.get("request_name") or report["kind"]),
            "succeeded": report["error_code"] == 1,
            "reason": report["reason"],
        }
        wall_s = float(report.get("planning_time_s") or 0.0)
        motion = next((path for path in unmatched if activity["succeeded"] and _belongs(path, report)), None)
        if motion is not None:
            unmatched.remove(motion)
        concurrent_plans = sum(begin < wall and end > wall - wall_s for begin, end in spans)
        figures = {PLANNING_TIME.name: wall_s, CONCURRENT.name: max(concurrent_plans, 1)} | {
            figure.name: report[figure.name]
            for figure in PLAN_FIGURES
            if isinstance(report.get(figure.name), int | float)
        }
        times_s = (report.get("started", report["time"]) - origin_s, report["time"] - origin_s)
        trajectory = motion.trajectory[-1].joint_trajectory if motion is not None else None
        reports.append(_report(activity, times_s, (wall - wall_s, wall), figures, trajectory))
    return reports


def _is_plan(report: dict[str, Any]) -> bool:
    """Returns whether a report concerns a plan; a feasible place is only the start of the plans to it."""
    kind = report["kind"]
    return kind in ("plan", "cartesian_path", "sequence") or (kind == "place" and report["error_code"] != 1)


def _belongs(path: Any, report: dict[str, Any]) -> bool:
    trajectory = path.trajectory[-1].joint_trajectory
    ends = ((trajectory.points[0], report.get("start")), (trajectory.points[-1], report.get("goal")))
    return all(
        known_positions
        and all(
            abs(known_positions.get(joint, value) - value) < 1e-4
            for joint, value in zip(trajectory.joint_names, point.positions, strict=True)
        )
        for point, known_positions in ends
    )


def _actions(samples: Samples, origin_s: float) -> list[dict[str, Any]]:
    reports = []
    for ended in samples.actions():
        trajectory = getattr(getattr(ended["goal"], "trajectory", None), "joint_trajectory", None)
        times_s = (ended["ros"] - origin_s, ended["ros_end"] - origin_s)
        wall_s = (ended["wall"], ended["wall_end"])
        reports.append(_report(ended, times_s, wall_s, {}, trajectory))
    return reports


def _components(samples: Samples, origin_s: float) -> list[dict[str, Any]]:
    return [
        _report(
            report,
            (report["started"] - origin_s, report["ended"] - origin_s),
            (wall - report["wall_s"], wall),
            report["figures"],
        )
        for wall, report in samples.components
    ]


def _report(
    activity: dict[str, Any],
    times_s: tuple[float, float],
    wall_s: tuple[float, float],
    figures: dict[str, float],
    trajectory: Any = None,
) -> dict[str, Any]:
    """Returns the report of an activity: a :class:`ComponentReport` in its written form, with start times.

    Args:
        activity: `component`, optionally `name`, and the result, `succeeded` and `reason`.
        times_s: Start and end in simulated time [s since the start of the recording].
        wall_s: Start and end by the machine's clock [s].
        figures: Measured figures.
        trajectory: trajectory_msgs/JointTrajectory of the motion; None without a motion.
    """
    return {
        "component": activity["component"],
        "name": activity.get("name", activity["component"]),
        "succeeded": activity["succeeded"],
        "reason": activity["reason"],
        "started_s": times_s[0],
        "ended_s": times_s[1],
        "wall_begin": wall_s[0],
        "wall_s": wall_s[1] - wall_s[0],
        "figures": figures,
        "motion": None if trajectory is None else _motion(trajectory),
    }
