# SPDX-License-Identifier: BSD-3-Clause
"""The mode `grasps`: grasp generation only, without simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from modular_framework_benchmark.experiments.mode import Mode, ReadSettings, count, named_values, setting
from modular_framework_benchmark.experiments.reading import Reading
from modular_framework_benchmark.experiments.resource_lookup import DEFAULT_LAUNCH
from modular_framework_benchmark.experiments.robot_setting import ModelSettings
from modular_framework_benchmark.experiments.scene_objects import ObjectNodes, placed_objects, read_objects
from modular_framework_benchmark.records.episode_settings import PlacedObject


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspSettings(ModelSettings):
    """Settings of an episode of the mode `grasps`.

    Attributes:
        group: Planning group whose tip is the grasp frame.
        gripper_joint: Joint of the gripper.
        method: MODULE:CLASS of the grasp generation method.
        method_parameters: Parameters of the method, keyed by name.
        objects: Objects around the robot, with absolute paths of their models.
        target: Name of the object to grasp; "" in a file for the first object.
        max_checks: Maximum number of grasps whose reachability is checked.
    """

    group: str = setting(Reading.optional_text, "", required=True)
    gripper_joint: str = setting(Reading.optional_text, "", required=True)
    method: str = setting(Reading.optional_text, "", required=True)
    method_parameters: Mapping[str, Any] = setting(named_values("{finger_clearance: 0.01}"), {})
    objects: tuple[PlacedObject, ...] = setting(read_objects, (), required=True)
    target: str = setting(Reading.optional_text, "")
    max_checks: int = setting(count(100_000), 40)

    @property
    def method_package(self) -> str:
        """Returns the package of the method."""
        return self.method.partition(":")[0].partition(".")[0]

    @property
    def packages(self) -> frozenset[str]:
        """Returns the packages of the robot and of the method."""
        return super(GraspSettings, self).packages | {self.method_package}


def _finish(
    read: ReadSettings[GraspSettings], nodes: Sequence[ObjectNodes], reading: Reading
) -> ReadSettings[GraspSettings]:
    """Finds the models and checks that the target is an object; the default target is the first object."""
    if "objects" in read.unreadable:
        return read
    before, target = len(reading.faults), read.settings.target
    objects = placed_objects(nodes, DEFAULT_LAUNCH, {}, reading)
    names = [item.name for item in objects]
    if not nodes:
        reading.faults.add(read.node.entries["objects"].location, "objects is empty; add at least the object to grasp")
    elif target and target not in names and len(reading.faults) == before:
        reading.faults.add_unknown(read.node.entries["target"].location, "the target", target, names)
    settings = replace(read.settings, target=target or (names[0] if names else ""))
    with_files = tuple(replace(item, model=str(item.file)) for item in objects)
    return replace(read, settings=settings, objects=with_files)


GRASPS = Mode(
    "grasps",
    GraspSettings,
    "modular_framework_benchmark.modes.ros_grasp_runner:GraspEpisodeRunner",
    "modular_framework_benchmark.modes.ros_setting_checks:check_grasps",
    frozenset({"generation"}),
    _finish,
)
