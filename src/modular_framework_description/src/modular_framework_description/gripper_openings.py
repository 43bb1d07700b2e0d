# SPDX-License-Identifier: BSD-3-Clause
"""Measures the openings of the grippers of the installed robots, to which the size of an object is compared."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import rospkg
from xacro_rospkg import expand

from modular_framework_core.commander.robot_groups import read_group
from modular_framework_core.files.default_folders import LAUNCH_FILE, srdf_file
from modular_framework_core.grasp_generation.gripper_geometry import driven_joint, measure_gripper
from modular_framework_urdf import xml_text
from modular_framework_urdf.srdf_reader import read_srdf


@dataclass(frozen=True, slots=True)
class GripperOpening:
    """Openings of a gripper.

    Attributes:
        name: Robot package and planning group of the gripper.
        least_m: Free width between the closed pads [m].
        greatest_m: Free width between the open pads [m].
    """

    name: str
    least_m: float
    greatest_m: float


@cache
def installed_grippers() -> tuple[GripperOpening, ...]:
    """Returns the openings of the two-finger grippers of the installed robots; omits other hands."""
    packages = rospkg.RosPack()
    launches = (Path(packages.get_path(name)) / "launch" / LAUNCH_FILE for name in sorted(packages.list()))
    return tuple(opening for launch in launches if launch.is_file() for opening in _grippers(launch))


def _grippers(launch: Path) -> Iterator[GripperOpening]:
    values = {item.get("name"): item.get("default", "") for item in xml_text.read(launch).findall("arg")}
    robot, srdf = values.get("robot_package", ""), srdf_file(values.get("moveit_config_package", ""))
    if not robot or srdf is None:
        return
    try:
        folder, semantic = Path(rospkg.RosPack().get_path(robot)), srdf.read_text(encoding="utf-8")
        arguments = dict(pair.split(":=", 1) for pair in values.get("urdf_args", "").split())
        urdf = expand(folder / "urdf" / values["robot_urdf_file"], arguments)
        effectors = read_srdf(semantic, str(srdf)).end_effectors
    except Exception:  # noqa: BLE001 - a robot that cannot be read is no fault of the object
        return
    for effector in effectors:
        try:
            tip = read_group(urdf, semantic, effector.parent_group).tip_link
            openings = measure_gripper(urdf, tip, driven_joint(urdf, semantic, effector.group)).openings
        except ValueError:  # no two-finger gripper
            continue
        yield GripperOpening(f"{robot}/{effector.group}", float(openings.min()), float(openings.max()))
