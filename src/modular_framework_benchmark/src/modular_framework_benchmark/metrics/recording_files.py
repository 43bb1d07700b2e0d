# SPDX-License-Identifier: BSD-3-Clause
"""Reads the recorded files of an episode.

| file | contents |
|---|---|
| `trajectory.parquet` | samples: `time_s`, `<joint>/position|velocity|effort|command`, poses of moving objects |
| `tracking.parquet` | `time_s`, `controller`, `joint`, `desired`, `actual` |
| `parameters.json` | all parameters of the parameter server |
| `recording.json` | `origin_s`: ROS time at the start of the recording; objects, grasps and reports of the components |
| `world.json` | record of the world by the simulation, as `read_world` reads it |
| `episode.json` | record of the episode as in the database, without `earlier_tries` |
| `task_records/` | record of the task by `run_task`: states with their userdata, and the structure of the machines |

`time_s` is simulated time since the start of the recording.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from modular_framework_benchmark.metrics.measurements import (
    Array,
    ComponentReport,
    JointSamples,
    Motion,
    ObjectTrack,
    TrackingSamples,
)
from modular_framework_benchmark.predicates.stages import SimulatedStage
from modular_framework_benchmark.predicates.world_track import read_world
from modular_framework_ros.reported_figures import declared_figure

TRAJECTORY, TRACKING, RECORDING = "trajectory.parquet", "tracking.parquet", "recording.json"
PARAMETERS, WORLD_RECORD = "parameters.json", "world.json"
EPISODE, TASK_RECORDS = "episode.json", "task_records"


def read_recording(folder: Path) -> dict[str, Any]:
    """Returns the contents of `recording.json`, empty without the file."""
    path = folder / RECORDING
    return dict(json.loads(path.read_text())) if path.is_file() else {}


def read_descriptions(folder: Path) -> tuple[str, str]:
    """Returns the robot's URDF and SRDF as text; "" if not recorded."""
    path = folder / PARAMETERS
    parameters = json.loads(path.read_text()) if path.is_file() else {}
    return str(parameters.get("robot_description", "")), str(parameters.get("robot_description_semantic", ""))


def read_stage(folder: Path, answer: Mapping[str, Any]) -> SimulatedStage | None:
    """Returns the true states of the world from the start of the task to its check; None if the task did not start.

    Args:
        folder: Folder of the episode's files.
        answer: `zero`: simulated time at the start of the recording [s]; `task_started_s`, `checked_s`: start of the
            task and its check [s since the start of the recording], absent if they were not reached.
    """
    path = folder / WORLD_RECORD
    if "task_started_s" not in answer or not path.is_file():
        return None
    record, ended_s = json.loads(path.read_text()), float(answer.get("checked_s", np.inf))
    world = read_world(record, float(answer["zero"]), float(answer["task_started_s"]), ended_s)
    return SimulatedStage(world) if len(world.times_s) else None


def reports_of(recording: Mapping[str, Any]) -> tuple[ComponentReport, ...]:
    """Returns the reports of the components in the order of their ends."""
    entries = sorted(recording.get("reports", ()), key=lambda entry: entry["wall_begin"] + entry["wall_s"])
    return tuple(
        ComponentReport(
            **{
                key: entry[key]
                for key in ("component", "name", "succeeded", "reason", "started_s", "ended_s", "wall_s")
            },
            figures={declared_figure(entry["component"], name): value for name, value in entry["figures"].items()},
            motion=_motion(entry["motion"]),
        )
        for entry in entries
    )


def _motion(entry: Mapping[str, Any] | None) -> Motion | None:
    if entry is None:
        return None
    return Motion(tuple(entry["joints"]), np.array(entry["times_s"]), np.array(entry["positions"]))


def objects_of(recording: Mapping[str, Any]) -> dict[str, ObjectTrack]:
    """Returns the tracks of the objects, keyed by name."""
    return {
        name: ObjectTrack(
            name,
            np.array(rows["time_s"]),
            np.column_stack([rows[axis] for axis in ("x", "y", "z")]),
            np.column_stack([rows[axis] for axis in ("qx", "qy", "qz", "qw")]),
        )
        for name, rows in recording.get("objects", {}).items()
    }


def read_joints(folder: Path) -> JointSamples | None:
    """Returns the measured joint states, or None if not recorded."""
    path = folder / TRAJECTORY
    if not path.is_file():
        return None
    frame = pd.read_parquet(path)
    joints = tuple(name.removesuffix("/position") for name in frame.columns if name.endswith("/position"))

    def columns(kind: str) -> Array:
        column_names = [f"{joint}/{kind}" for joint in joints]
        return np.asarray(frame.reindex(columns=column_names).to_numpy(dtype=float))

    times = np.asarray(frame["time_s"].to_numpy(dtype=float))
    return JointSamples(joints, times, *(columns(kind) for kind in ("position", "velocity", "effort", "command")))


def read_tracking(folder: Path) -> tuple[TrackingSamples, ...]:
    """Returns the tracking samples of the trajectory controllers."""
    path = folder / TRACKING
    if not path.is_file():
        return ()
    samples = []
    for controller, rows in pd.read_parquet(path).groupby("controller", sort=True):
        tables = {
            kind: rows.pivot_table(index="time_s", columns="joint", values=kind) for kind in ("desired", "actual")
        }
        desired, actual = tables["desired"], tables["actual"]
        samples.append(
            TrackingSamples(
                str(controller),
                tuple(map(str, desired.columns)),
                np.asarray(desired.index.to_numpy(dtype=float)),
                np.asarray(desired.to_numpy(dtype=float)),
                np.asarray(actual.to_numpy(dtype=float)),
            )
        )
    return tuple(samples)
