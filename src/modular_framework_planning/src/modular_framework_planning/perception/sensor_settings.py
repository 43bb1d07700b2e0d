# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the octomap's sensors, in the layout of MoveIt's sensors_3d.yaml (or sensor_plugins.yaml)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from modular_framework_planning.errors import ModelError

IGNORED_KEYS = ("sensor_plugin", "sensor_type", "name")  # keys for MoveIt's plugin loader

COUNTS = ("point_subsample", "queue_size")


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdaterSettings:
    """Settings of all octomap updaters, with MoveIt's keys and defaults.

    Attributes:
        max_update_rate: Maximum rate of processed messages [Hz]; 0 for no limit.
        filtered_cloud_topic: Topic for the data without robot and known objects, a cloud or a depth image (16UC1, mm);
            empty to disable.
        ns: Namespace of this topic within the node's namespace.
    """

    max_update_rate: float = 0.0
    filtered_cloud_topic: str = ""
    ns: str = ""


@dataclass(frozen=True, slots=True)
class PointCloudSettings(UpdaterSettings):
    """Settings of a PointCloudOctomapUpdater.

    Attributes:
        point_cloud_topic: Topic of type sensor_msgs/PointCloud2.
        max_range: Maximum range [m]; farther points only clear voxels.
        point_subsample: Step between used rows and between used columns.
        padding_offset: Padding of robot and known objects [m].
        padding_scale: Scale of robot and known objects.
    """

    point_cloud_topic: str
    max_range: float = float("inf")
    point_subsample: int = 1
    padding_offset: float = 0.0
    padding_scale: float = 1.0


@dataclass(frozen=True, slots=True)
class DepthImageSettings(UpdaterSettings):
    """Settings of a DepthImageOctomapUpdater.

    Attributes:
        image_topic: Topic of type sensor_msgs/Image; camera_info must be in the same namespace.
        queue_size: Maximum number of waiting images.
        near_clipping_plane_distance: Minimum valid depth [m].
        far_clipping_plane_distance: Maximum range [m]; farther measurements only clear voxels.
        shadow_threshold: Maximum distance of a measurement behind a body at which the measurement belongs to the body
            [m].
        padding_scale: Factor of the camera's depth noise in the padding.
        padding_offset: Padding of robot and known objects [m].
        skip_vertical_pixels: Number of rows left out at the top and at the bottom.
        skip_horizontal_pixels: Number of columns left out on the left and on the right.
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
    """Reads the parameter `sensors`.

    Args:
        entries: Value of the parameter; entries that are empty or have a plugin starting with "~" are disabled.
        max_range: Default range of point clouds [m].

    Returns:
        The valid sensors, and a message for each invalid entry.
    """
    if not isinstance(entries, list | tuple):
        return [], [f"sensors: got a {type(entries).__name__}; give a list of sensors"]
    sensors, faults = [], []
    for index, entry in enumerate(entries):
        if not entry or (isinstance(entry, dict) and str(entry.get("sensor_plugin", "")).startswith("~")):
            continue
        try:
            sensors.append(_read_sensor(entry, max_range))
        except ModelError as error:
            faults.append(f"sensors[{index}]: {error.reason}")
    return sensors, faults


def _read_sensor(entry: Any, max_range: float | None) -> SensorSettings:
    if not isinstance(entry, dict) or entry.get("sensor_plugin") not in PLUGINS:
        plugin = entry.get("sensor_plugin") if isinstance(entry, dict) else type(entry).__name__
        raise ModelError(f"sensor_plugin is '{plugin}'; supported plugins: {', '.join(PLUGINS)}")
    kind = PLUGINS[entry["sensor_plugin"]]
    known = {item.name: item.type for item in fields(kind)}
    values: dict[str, Any] = {} if max_range is None or kind is DepthImageSettings else {"max_range": max_range}
    for key, value in entry.items():
        if key in IGNORED_KEYS:
            continue
        if key not in known:
            raise ModelError(f"unknown key '{key}'; allowed keys: {', '.join(known)}")
        values[key] = _convert(key, value, {"str": str, "int": int, "float": float}[str(known[key])])
    if kind is PointCloudSettings and not values.get("point_cloud_topic"):
        raise ModelError("point_cloud_topic is missing; name the topic of the cloud")
    return kind(**values)


def _convert(key: str, value: Any, kind: type) -> Any:
    try:
        result = kind(value)
    except (TypeError, ValueError) as error:
        raise ModelError(f"{key} is {value!r}; give a value of type {kind.__name__}") from error
    minimum = 1 if key in COUNTS else 0
    if kind is not str and not result >= minimum:
        raise ModelError(f"{key} is {value!r}; give a number of at least {minimum}")
    return result
