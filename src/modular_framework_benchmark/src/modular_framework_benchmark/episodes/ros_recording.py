# SPDX-License-Identifier: BSD-3-Clause
"""Writes what was collected of an episode: `trajectory.parquet`, `tracking.parquet` and `recording.json`."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import rosgraph
import rospy
from numpy.typing import NDArray

from modular_framework_benchmark.episodes.ros_samples import Samples
from modular_framework_benchmark.metrics.recording_files import PARAMETERS, RECORDING, TRACKING, TRAJECTORY
from modular_framework_ros.reported_figures import ATTEMPTS, CLEARANCE, CONCURRENT, PLANNING_TIME, PROCESSOR_TIME

OF_A_RUN = ("run_id", "roslaunch", "seed")
"""Parameters that differ between episodes of the same configuration."""

MODELS_PERIOD_S = 0.02
SAME_TIME_S = 1e-6
POSE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def write_recording(
    folder: Path, samples: Samples, spawned: Mapping[str, str], answer: Mapping[str, Any], turns: float | None
) -> dict[str, Any]:
    """Writes the files of an episode.

    Args:
        folder: Where to write them.
        samples: What was collected.
        spawned: The models of the objects that were put into the world, by name.
        answer: `zero`: ROS time at which the recording begins [s]; `checked_s`, `simulated_s`: when success was checked
            and when everything had ended [s since then].
        turns: How often joint states are published while simulated time passes [1/s]; None: all count, see
            `joint_states_in_turn`.

    Returns:
        `final`: pose of each object when success was checked;
        `recording_fault`: what is missing in the recording, "" for nothing.
    """
    zero, end_s = float(answer["zero"]), float(answer.get("simulated_s", np.inf))
    poses = _object_poses(samples, list(spawned), answer)
    tracking = _within(_tracking(samples, zero), end_s)
    joints = samples.joints if turns is None else joint_states_in_turn(samples.joints, turns)
    trajectory = _with_objects(
        _within(_trajectory(joints, commands_of(tracking, samples.set_points, zero), zero), end_s), poses
    )
    trajectory.to_parquet(folder / TRAJECTORY)
    tracking.to_parquet(folder / TRACKING)
    content = {
        "objects": {name: rows.to_dict("list") for name, rows in poses.items()},
        "spawned": dict(spawned),
        "reports": [*_planning(samples, zero), *_actions(samples, zero), *_components(samples, zero)],
    }
    (folder / RECORDING).write_text(json.dumps(content))
    checked_s = float(answer.get("checked_s", np.inf))
    final = {name: _at(rows, checked_s) for name, rows in poses.items() if len(rows)}
    missing = 0 if turns is None else missing_turns(trajectory["time_s"].to_numpy() + zero, turns)
    faults = [f"{missing} joint states of {len(trajectory) + missing} did not arrive"] if missing else []
    if turns is not None and math.isfinite(end_s):
        faults += _model_faults(len(_model_messages(samples, spawned)), model_samples(zero, end_s)[1])
    return {"final": final, "recording_fault": "; ".join(faults)}


def _model_faults(came: int, expected: int) -> list[str]:
    if came == expected:
        return []
    return [f"{came} messages of the models came instead of {expected}: their poses have the times at which these came"]


def write_parameters(folder: Path) -> tuple[dict[str, Any], str]:
    """Writes all parameters of the parameter server; returns them and their SHA-256, hexadecimal.

    Args:
        folder: Where to write `parameters.json`.
    """
    # rospy answers from its cache, which may hold a part of them only
    parameters = rosgraph.Master(rospy.get_name()).getParam("/")
    text = json.dumps(parameters, sort_keys=True, indent=1)
    (folder / PARAMETERS).write_text(text)
    lasting = {name: value for name, value in parameters.items() if name not in OF_A_RUN}
    return parameters, hashlib.sha256(json.dumps(lasting, sort_keys=True).encode()).hexdigest()


def _within(rows: pd.DataFrame, end_s: float) -> pd.DataFrame:
    """Returns the samples after the begin of an episode, before which the world was another one, up to its end."""
    return rows[(rows["time_s"] > SAME_TIME_S) & (rows["time_s"] < end_s + SAME_TIME_S)].reset_index(drop=True)


def _at(rows: pd.DataFrame, time_s: float) -> list[float]:
    """Returns the pose at the last sample up to a time, or at the first."""
    row = max(int(np.searchsorted(rows["time_s"].to_numpy(), time_s, side="right")) - 1, 0)
    return [float(rows[column].iloc[row]) for column in POSE_COLUMNS]


def _object_poses(samples: Samples, names: Sequence[str], answer: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Returns the poses of all models, by name; what stands still all the time has one row."""
    messages = _model_messages(samples, names)
    rows: dict[str, list[tuple[float, ...]]] = {}
    for time_s, (_, message) in zip(_sample_times(messages, answer), messages, strict=True):
        for name, pose in zip(message.name, message.pose, strict=True):
            place, turn = pose.position, pose.orientation
            rows.setdefault(name, []).append((time_s, place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w))
    frames = {name: pd.DataFrame(found, columns=["time_s", *POSE_COLUMNS]) for name, found in rows.items()}
    return {
        name: frame if len(frame[list(POSE_COLUMNS)].drop_duplicates()) > 1 else frame.iloc[[0]]
        for name, frame in frames.items()
    }


def _model_messages(samples: Samples, names: Collection[str]) -> list[tuple[float, Any]]:
    """Returns the messages of the models; one from before the episode has not all objects yet."""
    return [(stamp, message) for stamp, message in samples.models if set(names) <= set(message.name)]


def model_samples(zero: float, end_s: float) -> tuple[int, int]:
    """Returns the number of the first sample of the models in an episode, and how many there are.

    The simulation sends them at whole multiples of `MODELS_PERIOD_S`.

    Args:
        zero: ROS time at which the recording begins [s].
        end_s: Its end [s since then].
    """
    first = math.floor(zero / MODELS_PERIOD_S + SAME_TIME_S) + 1
    return first, math.floor((zero + end_s) / MODELS_PERIOD_S + SAME_TIME_S) - first + 1


def _sample_times(messages: Sequence[tuple[float, Any]], answer: Mapping[str, Any]) -> list[float]:
    """Returns times of messages of the world, which have no stamp: counted, or where one is lost when they came."""
    zero = float(answer["zero"])
    first, count = model_samples(zero, float(answer.get("simulated_s", -1.0)))
    if len(messages) == count:
        return [(first + number) * MODELS_PERIOD_S - zero for number in range(count)]
    return [stamp - zero for stamp, _ in messages]


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


def joint_states_in_turn(messages: Sequence[Any], turns: float) -> list[Any]:
    """Returns the joint states that are published at a fixed rate, without those of moments when time stood still.

    A simulation whose time is held also publishes the state in which it stands still. Whether time does so between two
    requests for it to pass depends on the load of the machine, so that these states would differ from run to run.

    Args:
        messages: sensor_msgs/JointState, in the order of their stamps.
        turns: The rate [1/s]; the first turn is at time 0.
    """
    in_turn: dict[tuple[int, tuple[str, ...]], Any] = {}
    for message in messages:
        turn = int(_turns_of(message.header.stamp.to_sec(), turns))
        in_turn.setdefault((turn, tuple(message.name)), message)
    return list(in_turn.values())


def missing_turns(times_s: NDArray[np.float64], turns: float) -> int:
    """Returns how many turns there are between the first and the last time in which there is none.

    Args:
        times_s: Ascending [s], at most one in a turn.
        turns: Their rate [1/s].
    """
    numbers = _turns_of(times_s, turns)
    return int(numbers[-1] - numbers[0]) + 1 - len(numbers) if len(numbers) else 0


def _turns_of(times_s: Any, turns: float) -> Any:
    return np.floor(times_s * turns + SAME_TIME_S)


def commands_of(tracking: pd.DataFrame, set_points: Sequence[tuple[str, Any]], zero: float) -> pd.DataFrame:
    """Returns what controllers command: time_s, joint, desired.

    Args:
        tracking: Samples of the trajectory controllers.
        set_points: Joint and control_msgs/JointControllerState of the controllers of one joint. The stamps of clients'
            goals depend on when the clock reaches the client.
        zero: ROS time at which the recording begins [s].
    """
    rows = [(state.header.stamp.to_sec() - zero, joint, state.set_point) for joint, state in set_points]
    columns = ["time_s", "joint", "desired"]
    return pd.concat([tracking[columns], pd.DataFrame(rows, columns=columns)]) if rows else tracking[columns]


def _trajectory(joints: Sequence[Any], commands: pd.DataFrame, zero: float) -> pd.DataFrame:
    """Returns a row for each time: `time_s`, and position, velocity, effort and command of each joint."""
    rows: dict[float, dict[str, float]] = {}
    for message in joints:
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
    for joint, wanted in commands.sort_values("time_s").groupby("joint"):
        last = np.searchsorted(wanted["time_s"].to_numpy(), frame["time_s"].to_numpy(), side="right") - 1
        values = wanted["desired"].to_numpy()
        frame[f"{joint}/command"] = np.where(last >= 0, values[np.maximum(last, 0)], np.nan)
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
    plans = [entry for entry in samples.planning if entry[1]["kind"] in ("plan", "cartesian_path", "sequence")]
    spans = [(wall - float(report.get("planning_time_s") or 0.0), wall) for wall, report in plans]
    for wall, report in plans:
        work = {
            "component": "planning",
            "name": str(report.get("request_name") or report["kind"]),
            "succeeded": report["error_code"] == 1,
            "reason": report["reason"],
        }
        wall_s = float(report.get("planning_time_s") or 0.0)
        motion = next((path for path in shown if work["succeeded"] and _belongs(path, report)), None)
        if motion is not None:
            shown.remove(motion)
        at_once = sum(begin < wall and end > wall - wall_s for begin, end in spans)
        figures = {PLANNING_TIME.name: wall_s, CONCURRENT.name: max(at_once, 1)} | {
            figure.name: report[figure.name]
            for figure in (CLEARANCE, ATTEMPTS, PROCESSOR_TIME)
            if isinstance(report.get(figure.name), int | float)
        }
        times_s = (report.get("started", report["time"]) - zero, report["time"] - zero)
        trajectory = motion.trajectory[-1].joint_trajectory if motion is not None else None
        reports.append(_report(work, times_s, (wall - wall_s, wall), figures, trajectory))
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
    for ended in samples.actions():
        trajectory = getattr(getattr(ended["goal"], "trajectory", None), "joint_trajectory", None)
        times_s = (ended["ros"] - zero, ended["ros_end"] - zero)
        wall_s = (ended["wall"], ended["wall_end"])
        reports.append(_report(ended, times_s, wall_s, {}, trajectory))
    return reports


def _components(samples: Samples, zero: float) -> list[dict[str, Any]]:
    return [
        _report(
            report,
            (report["started"] - zero, report["ended"] - zero),
            (wall - report["wall_s"], wall),
            report["figures"],
        )
        for wall, report in samples.components
    ]


def _report(
    work: dict[str, Any],
    times_s: tuple[float, float],
    wall_s: tuple[float, float],
    figures: dict[str, float],
    trajectory: Any = None,
) -> dict[str, Any]:
    """Returns the report of a piece of work: a :class:`ComponentReport` as it is written, and when it began.

    Args:
        work: What did it, `component` and maybe `name`, and how it ended, `succeeded` and `reason`.
        times_s: Its start and end since the recording began, simulated time [s].
        wall_s: Its start and end by the machine's clock [s].
        figures: Its own figures.
        trajectory: trajectory_msgs/JointTrajectory of its motion; None without one.
    """
    return {
        "component": work["component"],
        "name": work.get("name", work["component"]),
        "succeeded": work["succeeded"],
        "reason": work["reason"],
        "started_s": times_s[0],
        "ended_s": times_s[1],
        "wall_begin": wall_s[0],
        "wall_s": wall_s[1] - wall_s[0],
        "figures": figures,
        "motion": None if trajectory is None else _motion(trajectory),
    }
