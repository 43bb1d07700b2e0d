# SPDX-License-Identifier: BSD-3-Clause
"""Reads the sensors that feed the octomap, in the layout of MoveIt's sensors_3d.yaml (or sensor_plugins.yaml)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from modular_framework_planning.errors import ModelError

IGNORED_KEYS = ("sensor_plugin", "sensor_type", "name")  # known to MoveIt's own readers, of no use here

COUNTS = ("point_subsample", "queue_size")


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdaterSettings:
    """Settings of every octomap updater; keys and defaults are MoveIt's.

    Attributes:
        max_update_rate: messages processed a second at most [Hz]; 0 for all.
        filtered_cloud_topic: where what is left without the robot and the objects is published, a cloud or a depth
            image (16UC1, mm); empty for nowhere.
        ns: namespace of that topic within the node's.
    """

    max_update_rate: float = 0.0
    filtered_cloud_topic: str = ""
    ns: str = ""


@dataclass(frozen=True, slots=True)
class PointCloudSettings(UpdaterSettings):
    """A PointCloudOctomapUpdater.

    Attributes:
        point_cloud_topic: sensor_msgs/PointCloud2.
        max_range: points further away only clear [m].
        point_subsample: every n-th point of every n-th row is used.
        padding_offset, padding_scale: how much larger the robot and the objects are taken [m and 1].
    """

    point_cloud_topic: str
    max_range: float = float("inf")
    point_subsample: int = 1
    padding_offset: float = 0.0
    padding_scale: float = 1.0


@dataclass(frozen=True, slots=True)
class DepthImageSettings(UpdaterSettings):
    """A DepthImageOctomapUpdater.

    Attributes:
        image_topic: sensor_msgs/Image; camera_info is expected beside it.
        queue_size: images that may wait.
        near_clipping_plane_distance, far_clipping_plane_distance: readings outside are left out, or only clear [m].
        shadow_threshold: a reading this little behind the robot or an object belongs to it [m].
        padding_scale: how many times the camera's depth noise is added to the padding [1].
        padding_offset: padding of the robot and of objects [m].
        skip_vertical_pixels, skip_horizontal_pixels: border that is left out on each side [pixel].
    """

    image_topic: str = "depth"
    queue_size: int = 5
    near_clipping_plane_distance: float = 0.3
    far_clipping_plane_distance: float = 5.0
    shadow_threshold: float = 0.04
    padding_scale: float = 0.0
    padding_offset: float = 0.02
    skip_vertical_pixels: int = 4
    skip_horizontal_pixels: int = 6


SensorSettings = PointCloudSettings | DepthImageSettings
PLUGINS: Mapping[str, type[PointCloudSettings] | type[DepthImageSettings]] = {
    "occupancy_map_monitor/PointCloudOctomapUpdater": PointCloudSettings,
    "occupancy_map_monitor/DepthImageOctomapUpdater": DepthImageSettings,
}


def read_sensors(entries: Any, max_range: float | None) -> tuple[list[SensorSettings], list[str]]:
    """Reads a list of sensors.

    Args:
        entries: the parameter `sensors`; entries that are empty, or whose plugin begins with "~", are switched off.
        max_range: range of clouds that name none [m].

    Returns:
        The sensors that can be used, and a sentence for each entry that cannot.
    """
    if not isinstance(entries, list | tuple):
        return [], [f"sensors: got a {type(entries).__name__}; a list of sensors is needed"]
    sensors, faults = [], []
    for number, entry in enumerate(entries):
        if not entry or (isinstance(entry, dict) and str(entry.get("sensor_plugin", "")).startswith("~")):
            continue
        try:
            sensors.append(_read_sensor(entry, max_range))
        except ModelError as error:
            faults.append(f"sensors[{number}]: {error.reason}")
    return sensors, faults


def _read_sensor(entry: Any, max_range: float | None) -> SensorSettings:
    if not isinstance(entry, dict) or entry.get("sensor_plugin") not in PLUGINS:
        got = entry.get("sensor_plugin") if isinstance(entry, dict) else type(entry).__name__
        raise ModelError(f"sensor_plugin is '{got}'; allowed are {', '.join(PLUGINS)}")
    kind = PLUGINS[entry["sensor_plugin"]]
    known = {item.name: item.type for item in fields(kind)}
    values: dict[str, Any] = {} if max_range is None or kind is DepthImageSettings else {"max_range": max_range}
    for key, value in entry.items():
        if key in IGNORED_KEYS:
            continue
        if key not in known:
            raise ModelError(f"unknown key '{key}'; allowed are {', '.join(known)}")
        values[key] = _converted(key, value, {"str": str, "int": int, "float": float}[str(known[key])])
    if kind is PointCloudSettings and not values.get("point_cloud_topic"):
        raise ModelError("point_cloud_topic is missing; name the topic of the cloud")
    return kind(**values)


def _converted(key: str, value: Any, kind: type) -> Any:
    try:
        result = kind(value)
    except (TypeError, ValueError) as error:
        raise ModelError(f"{key} is {value!r}; a value of type {kind.__name__} is needed") from error
    least = 1 if key in COUNTS else 0
    if kind is not str and not result >= least:
        raise ModelError(f"{key} is {value!r}; a number of {least} or more is needed")
    return result
