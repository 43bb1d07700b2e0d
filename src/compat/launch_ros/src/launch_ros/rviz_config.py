# SPDX-License-Identifier: BSD-3-Clause
"""Converts RViz configurations of ROS 2 to ROS 1 by renaming classes and properties."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import rospkg
import yaml
from launch.core.screen_log import get_logger
from launch.ros_packages import package_share_directory, plugin_descriptions

from launch_ros.node_parameters import DESCRIPTION
from modular_framework_urdf import xml_text

ROS2_PACKAGES = ("rviz_default_plugins", "rviz_common")
"""Packages of ROS 2 whose classes are in the package `rviz` of ROS 1."""
RENAMED = {"rviz_default_plugins/Wrench": "rviz/WrenchStamped"}
BUILT_IN = ("Group", "Displays", "Help", "Selection", "Time", "Tool Properties", "Views")
"""Classes of RViz without a plugin description."""
TOPIC_NAMES = {
    "rviz/Marker": "Marker Topic",
    "rviz/MarkerArray": "Marker Topic",
    "rviz/Image": "Image Topic",
    "rviz/Camera": "Image Topic",
}
"""Topic property of ROS 1 displays whose property is not named `Topic`."""
MOVEIT = "moveit_rviz_plugin/"
SCENE_CLASSES = ("rviz/RobotModel", "rviz/MarkerArray", "rviz/InteractiveMarkers")

Config = dict[str, Any]


@dataclass
class RvizTranslator:
    """Converts RViz configurations.

    Args:
        classes: Classes of RViz on ROS 1.
        moveit_displays: Displays that replace the displays of MoveIt's plugin.
    """

    classes: Collection[str]
    moveit_displays: Sequence[Config] = ()
    remarks: list[str] = field(default_factory=list, init=False)

    def config(self, config: Mapping[str, Any]) -> Config:
        """Returns the configuration for ROS 1, and adds missing parts to `remarks`."""
        ros1 = dict(config)
        if "Panels" in ros1:
            ros1["Panels"] = self._entries("panel", ros1["Panels"], _same)
        manager = ros1.get("Visualization Manager")
        if isinstance(manager, Mapping):
            ros1["Visualization Manager"] = self._manager(manager)
        return ros1

    def _manager(self, manager: Mapping[str, Any]) -> Config:
        ros1 = {key: value for key, value in manager.items() if key != "Transformation"}
        if "Displays" in ros1:
            ros1["Displays"] = self._displays(ros1["Displays"])
        if "Tools" in ros1:
            ros1["Tools"] = self._entries("tool", ros1["Tools"], _properties)
        views = ros1.get("Views")
        if isinstance(views, Mapping):
            ros1["Views"] = self._views(views)
        return ros1

    def _views(self, views: Mapping[str, Any]) -> Config:
        """Converts the views; if the class of the current view is missing, RViz starts with its default view."""
        ros1 = dict(views)
        current = ros1.pop("Current", None)
        for view in self._entries("view", [current], _view):
            ros1["Current"] = view
        if ros1.get("Saved"):
            ros1["Saved"] = self._entries("view", ros1["Saved"], _view)
        return ros1

    def _displays(self, entries: Any) -> list[Config]:
        """Converts the displays, including groups; one group replaces all displays of MoveIt's plugin."""
        displays: list[Config] = []
        for entry in self._entries("display", self._without_moveit(entries), _properties):
            inner = {"Displays": self._displays(entry["Displays"])} if "Displays" in entry else {}
            displays.append(entry | inner)
            if entry["Class"] == "rviz/RobotModel" and entry.get("Description Source") == "File":
                parameter = entry.get("Robot Description", DESCRIPTION)
                self.remarks.append(
                    f"display '{entry.get('Name', 'RobotModel')}' shows the robot of parameter {parameter} instead of "
                    f"file '{entry.get('Description File', '')}', because RViz of ROS 1 reads only parameters"
                )
        return displays

    def _without_moveit(self, entries: Any) -> list[Any]:
        kept, moveit = [], []
        for entry in entries or []:
            name = str(entry.get("Class")) if isinstance(entry, Mapping) else ""
            replaced = self.moveit_displays and name.startswith(MOVEIT) and name not in self.classes
            (moveit if replaced else kept).append(entry)
        if not moveit:
            return kept
        names = ", ".join(str(entry.get("Name", entry["Class"])) for entry in moveit)
        self.remarks.append(
            f"displays {names} of MoveIt's plugin are replaced by the displays of moveit_ros_visualization"
        )
        enabled = any(entry.get("Enabled", True) for entry in moveit)
        displays = [dict(each) for each in self.moveit_displays]
        return [*kept, {"Class": "rviz/Group", "Name": "MoveIt", "Enabled": enabled, "Displays": displays}]

    def _entries(self, kind: str, entries: Any, translate: Callable[[Config], Config]) -> list[Config]:
        found: list[Config] = []
        for entry in entries or []:
            if not isinstance(entry, Mapping):
                continue
            own = str(entry.get("Class"))
            name = ros1_class(own)
            if name in self.classes:
                found.append(translate({**entry, "Class": name}))
            else:
                called = f"'{entry['Name']}' " if entry.get("Name") else ""
                self.remarks.append(f"{kind} {called}({own}) is left out, because RViz of ROS 1 has no such class")
        return found


def ros1_class(name: str) -> str:
    """Returns the ROS 1 name of an RViz class of ROS 2; other names are not changed."""
    package, _, own = name.partition("/")
    return RENAMED.get(name, f"rviz/{own}" if package in ROS2_PACKAGES else name)


def _same(entry: Config) -> Config:
    return entry


def _view(entry: Config) -> Config:
    """Converts the type of a view in RViz's list, such as `FPS (rviz_default_plugins)`."""
    value = entry.get("Value")
    renamed = {"Value": value.replace("(rviz_default_plugins)", "(rviz)")} if isinstance(value, str) else {}
    return entry | renamed


def _properties(entry: Config) -> Config:
    """Converts topics of a display or tool to names; in ROS 2, a topic is a name or a mapping with any settings."""
    ros1: Config = {}
    for key, value in entry.items():
        own = TOPIC_NAMES.get(entry["Class"], key) if key == "Topic" else key
        has_settings = str(key).endswith("Topic") and isinstance(value, Mapping) and "Value" in value
        ros1[own] = value["Value"] if has_settings else value
        if has_settings and own in ("Topic", "Image Topic") and value.get("Reliability Policy") == "Best Effort":
            ros1["Unreliable"] = True
    if "Description Topic" in ros1:  # ROS 1 reads the description from a parameter with this name
        ros1["Robot Description"] = ros1.pop("Description Topic") or DESCRIPTION
    if "Interactive Markers Namespace" in ros1:
        ros1["Update Topic"] = f"{str(ros1.pop('Interactive Markers Namespace')).rstrip('/')}/update"
    return ros1


def ros1_config_file(path: Path) -> Path:
    """Returns a configuration file for RViz on ROS 1: the given file, or a converted file in the ROS home folder.

    Converted files are in `$ROS_HOME/modular_framework/rviz`. Each missing part is logged. A missing or invalid file is
    not converted, because RViz reports its fault.
    """
    try:
        config = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        return path
    if not isinstance(config, Mapping):
        return path
    classes = {*_plugin_classes(plugin_descriptions("rviz")), *(f"rviz/{name}" for name in BUILT_IN)}
    translator = RvizTranslator(classes, _moveit_displays())
    ros1 = translator.config(config)
    if ros1 == config:
        return path
    for remark in translator.remarks:
        get_logger("rviz").warning("%s: %s", path, remark)
    digest = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]
    target = Path(rospkg.get_ros_home()) / "modular_framework" / "rviz" / f"{path.stem}_{digest}{path.suffix}"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(yaml.safe_dump(ros1, sort_keys=False), encoding="utf-8")
    get_logger("rviz").info("%s is converted for ROS 1: %s", path, target)
    return target


def _plugin_classes(descriptions: Iterable[Path]) -> set[str]:
    """Returns the classes in plugin descriptions, except in unreadable files, which pluginlib reports."""
    found = set()
    for description in descriptions:
        with contextlib.suppress(OSError, xml_text.XmlError):
            classes = xml_text.read(description).iter("class")
            found |= {name for each in classes if (name := each.get("name") or each.get("type"))}
    return found


def _moveit_displays() -> list[Config]:
    """Returns the displays of robot, scene, motions and goal in the configuration of moveit_ros_visualization."""
    try:
        share = Path(package_share_directory("moveit_ros_visualization"))
        config = yaml.safe_load((share / "config" / "moveit.rviz").read_text(encoding="utf-8"))
    except (LookupError, OSError):
        return []
    return [each for each in config["Visualization Manager"]["Displays"] if each["Class"] in SCENE_CLASSES]
