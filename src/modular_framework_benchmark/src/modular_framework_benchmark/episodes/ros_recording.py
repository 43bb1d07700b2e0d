# SPDX-License-Identifier: BSD-3-Clause
"""Writes what was collected of an episode: `trajectory.parquet`, `tracking.parquet` and `recording.json`."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import rospy

from modular_framework_benchmark.episodes.ros_samples import Samples
from modular_framework_benchmark.metrics.recording_files import PARAMETERS, RECORDING, TRACKING, TRAJECTORY

OF_A_RUN = ("run_id", "roslaunch", "seed")
"""Parameters that differ between episodes of the same configuration."""

POSE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def write_recording(folder: Path, samples: Samples, request: Any, zero: float) -> dict[str, Any]:
    """Writes the files of an episode.

    Args:
        folder: Where to write them.
        samples: What was collected.
        request: What was run: `objects` and `target`.
        zero: ROS time at which the episode's recording begins [s].

    Returns:
        `lifted_m`, `held` and `final`: what became of the objects.
    """
    names = [entry["name"] for entry in request.objects]
    poses = _object_poses(samples, zero)
    tracking = _tracking(samples, zero)
    trajectory = _trajectory(samples, tracking, zero)
    trajectory = _with_objects(trajectory, poses)
    trajectory.to_parquet(folder / TRAJECTORY)
    tracking.to_parquet(folder / TRACKING)
    grasped = [[time_s - zero, text] for time_s, text in samples.grasped]
    content = {
        "objects": {name: rows.to_dict("list") for name, rows in poses.items()},
        "spawned": names,
        "target": request.target,
        "grasped": grasped,
        "reports": [*_planning(samples, zero), *_actions(samples, zero), *_components(samples, zero)],
    }
    (folder / RECORDING).write_text(json.dumps(content))
    return _final(poses, grasped, request.target)


def write_parameters(folder: Path) -> str:
    """Writes all parameters of the parameter server; returns their SHA-256, hexadecimal.

    Args:
        folder: Where to write `parameters.json`.
    """
    parameters = rospy.get_param("/")
    text = json.dumps(parameters, sort_keys=True, indent=1)
    (folder / PARAMETERS).write_text(text)
    for name in OF_A_RUN:
        parameters.pop(name, None)
    return hashlib.sha256(json.dumps(parameters, sort_keys=True).encode()).hexdigest()


def _final(poses: dict[str, pd.DataFrame], grasped: list[list[Any]], target: str) -> dict[str, Any]:
    held = bool(target) and bool(grasped) and target in str(grasped[-1][1]).split(",")
    track = poses.get(target)
    lifted = float(track["z"].iloc[-1] - track["z"].iloc[0]) if track is not None and len(track) else None
    final = {
        name: [float(rows[column].iloc[-1]) for column in POSE_COLUMNS] for name, rows in poses.items() if len(rows)
    }
    return {"lifted_m": lifted, "held": held, "final": final}


def _object_poses(samples: Samples, zero: float) -> dict[str, pd.DataFrame]:
    """Returns the poses of the objects that move or could, by name: what stands still all the time has one row."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    for time_s, message in samples.models:
        for name, pose in zip(message.name, message.pose, strict=True):
            place, turn = pose.position, pose.orientation
            rows.setdefault(name, []).append((time_s - zero, place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w))
    frames = {name: pd.DataFrame(found, columns=["time_s", *POSE_COLUMNS]) for name, found in rows.items()}
    return {
        name: frame if len(frame[list(POSE_COLUMNS)].drop_duplicates()) > 1 else frame.iloc[[0]]
        for name, frame in frames.items()
    }


def _tracking(samples: Samples, zero: float) -> pd.DataFrame:
    """Returns a row for each joint of each message: time_s, controller, joint, desired, actual."""
    rows = [
        (message.header.stamp.to_sec() - zero, name, joint, desired, actual)
        for name, message in samples.controllers
        for joint, desired, actual in zip(
            message.joint_names, message.desired.positions, message.actual.positions, strict=False
        )
    ]
    return pd.DataFrame(rows, columns=["time_s", "controller", "joint", "desired", "actual"])


def _trajectory(samples: Samples, tracking: pd.DataFrame, zero: float) -> pd.DataFrame:
    """Returns a row for each time: `time_s`, and position, velocity, effort and command of each joint."""
    rows: dict[float, dict[str, float]] = {}
    for message in samples.joints:
        row = rows.setdefault(message.header.stamp.to_sec() - zero, {})
        for kind, values in (
            ("position", message.position),
            ("velocity", message.velocity),
            ("effort", message.effort),
        ):
            row.update((f"{joint}/{kind}", value) for joint, value in zip(message.name, values, strict=False))
    frame = pd.DataFrame.from_dict(rows, orient="index").sort_index()
    frame.insert(0, "time_s", frame.index.to_numpy(dtype=float))
    frame = frame.reset_index(drop=True)
    for joint, wanted in tracking.sort_values("time_s").groupby("joint"):
        commands = np.searchsorted(wanted["time_s"].to_numpy(), frame["time_s"].to_numpy(), side="right") - 1
        values = wanted["desired"].to_numpy()
        frame[f"{joint}/command"] = np.where(commands >= 0, values[np.maximum(commands, 0)], np.nan)
    return frame


def _with_objects(trajectory: pd.DataFrame, poses: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Adds the pose of each moving object, at the sample before."""
    columns = {}
    for name, rows in poses.items():
        if len(rows) < 2 or not len(trajectory):
            continue
        found = np.searchsorted(rows["time_s"].to_numpy(), trajectory["time_s"].to_numpy(), side="right") - 1
        for column in POSE_COLUMNS:
            columns[f"{name}/{column}"] = rows[column].to_numpy()[np.maximum(found, 0)]
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


def _planning(samples: Samples, zero: float) -> list[dict[str, Any]]:
    """Returns the reports of plans, each with the motion that has its start and its goal."""
    shown = [path for path in samples.paths if path.trajectory]
    reports = []
    for wall, report in samples.planning:
        if report["kind"] not in ("plan", "cartesian_path", "sequence"):
            continue
        succeeded = report["error_code"] == 1
        wall_s = float(report.get("planning_time_s") or 0.0)
        motion = next((path for path in shown if succeeded and _belongs(path, report)), None)
        if motion is not None:
            shown.remove(motion)
        reports.append(
            {
                "component": "planning",
                "name": str(report.get("request_name") or report["kind"]),
                "succeeded": succeeded,
                "reason": report["reason"],
                "started_s": report.get("started", report["time"]) - zero,
                "ended_s": report["time"] - zero,
                "wall_begin": wall - wall_s,
                "wall_s": wall_s,
                "figures": {"planning_time_s": wall_s}
                | {key: report[key] for key in ("clearance_m", "attempts") if isinstance(report.get(key), int | float)},
                "motion": _motion(motion.trajectory[-1].joint_trajectory) if motion is not None else None,
            }
        )
    return reports


def _belongs(path: Any, report: dict[str, Any]) -> bool:
    trajectory = path.trajectory[-1].joint_trajectory
    ends = ((trajectory.points[0], report.get("start")), (trajectory.points[-1], report.get("goal")))
    return all(
        known
        and all(
            abs(known.get(joint, value) - value) < 1e-4
            for joint, value in zip(trajectory.joint_names, point.positions, strict=True)
        )
        for point, known in ends
    )


def _actions(samples: Samples, zero: float) -> list[dict[str, Any]]:
    reports = []
    for ended in samples.actions:
        trajectory = getattr(getattr(ended["goal"], "trajectory", None), "joint_trajectory", None)
        reports.append(
            {
                "component": ended["component"],
                "name": ended["component"],
                "succeeded": ended["succeeded"],
                "reason": ended["reason"],
                "started_s": ended["ros"] - zero,
                "ended_s": ended["ros_end"] - zero,
                "wall_begin": ended["wall"],
                "wall_s": ended["wall_end"] - ended["wall"],
                "figures": {},
                "motion": _motion(trajectory) if trajectory is not None else None,
            }
        )
    return reports


def _components(samples: Samples, zero: float) -> list[dict[str, Any]]:
    return [
        {
            "component": report["component"],
            "name": report["name"],
            "succeeded": report["succeeded"],
            "reason": report["reason"],
            "started_s": report["started"] - zero,
            "ended_s": report["ended"] - zero,
            "wall_begin": wall - report["wall_s"],
            "wall_s": report["wall_s"],
            "figures": report["figures"],
            "motion": None,
        }
        for wall, report in samples.components
    ]
