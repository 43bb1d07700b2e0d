# SPDX-License-Identifier: BSD-3-Clause
"""Writes the recording of a small scene: carriage on a rail, table, rising cube, and a model without a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

LAST_S = 20
"""Time of the last sample [s since the start of the recording]."""
REMOVED_S = 15
"""Time at which the cube is removed [s since the start of the recording]."""
ROBOT = """<robot name="lifter">
  <link name="rail"><visual><geometry><box size="0.05 0.05 1"/></geometry></visual></link>
  <link name="carriage"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
  <joint name="pan" type="prismatic"><parent link="rail"/><child link="carriage"/><origin xyz="0.2 0 0"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="100" effort="1" velocity="1"/></joint></robot>"""
_BOX = "<geometry><box><size>{size}</size></box></geometry>"
_LINK = "<link name='{name}'><pose>0 0 0.1 0 0 0</pose><visual name='seen'>{box}</visual></link>"
WORLD = f"""<sdf version='1.6'><world name='room'><model name='table'><static>true</static>
  {_LINK.format(name="top", box=_BOX.format(size="1 1 0.2"))}</model></world></sdf>"""
CUBE = f"""<sdf version='1.6'><model name='cube'>
  {_LINK.format(name="body", box=_BOX.format(size="0.05 0.05 0.05"))}</model></sdf>"""
PARCEL_BOX = [[-0.1, -0.2, 0.0], [0.1, 0.2, 0.3]]
"""Smallest and largest corner of the model without a file [m]."""


def write_scene(folder: Path, origin_s: float) -> None:
    """Writes the scene into the folder of an episode; the carriage and the cube rise by 1 m/s.

    Args:
        folder: Folder of the episode, which exists.
        origin_s: ROS time at the start of the recording [s].
    """
    (folder / "models" / "cube").mkdir(parents=True)
    (folder / "models" / "cube" / "model.sdf").write_text(CUBE)
    (folder / "room.world").write_text(WORLD)
    parameters = {
        "robot_description": ROBOT,
        "gazebo": {"world_file": str(folder / "room.world")},
        "gazebo_model_path": str(folder / "models"),
    }
    (folder / "parameters.json").write_text(json.dumps(parameters))
    samples: list[list[Any]] = []
    for time_s in range(LAST_S + 1):
        fixed = {"lifter": _state(0.0, 0.0), "table": _state(1.0, 0.0), "parcel": _state(2.0, 0.0)}
        moving = {"cube_1": _state(1.0, float(time_s)) if time_s < REMOVED_S else None}
        samples.append([origin_s + time_s, moving if time_s else fixed | moving, None, None])
    world = {"samples": samples, "boxes": {"parcel": PARCEL_BOX}, "robots": ["lifter"]}
    (folder / "world.json").write_text(json.dumps(world))
    (folder / "recording.json").write_text(
        json.dumps({"origin_s": origin_s, "reports": [], "spawned": {"cube_1": "cube"}})
    )
    times_s = [0.5 * number for number in range(2 * LAST_S)]
    pd.DataFrame({"time_s": times_s, "pan/position": times_s}).to_parquet(folder / "trajectory.parquet")


def _state(x: float, z: float) -> list[Any]:
    """Returns the state of an upright model at rest: pose, twist and joints."""
    return [x, 0.0, z, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6, {}]
