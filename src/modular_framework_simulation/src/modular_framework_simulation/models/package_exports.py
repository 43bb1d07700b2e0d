# SPDX-License-Identifier: BSD-3-Clause
"""Finds the model and media folders that ROS packages export for Gazebo.

A package declares the folders in its package.xml, as in gazebo_ros:
`<export><gazebo_ros gazebo_model_path="${prefix}/models" gazebo_media_path="${prefix}"/></export>`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.xml_nodes import read_xml

MODEL_EXPORT, MEDIA_EXPORT = "gazebo_model_path", "gazebo_media_path"


def exported_folders(packages: Iterable[Path], export: str) -> tuple[Path, ...]:
    """Returns the exported folders of packages.

    Args:
        packages: Package folders.
        export: `MODEL_EXPORT` or `MEDIA_EXPORT`.
    """
    folders: dict[Path, None] = {}
    for package in packages:
        manifest = package / "package.xml"
        try:
            if export.encode() not in manifest.read_bytes():  # parse only the few packages with an export
                continue
            root = read_xml(manifest)
        except (OSError, DescriptionError):  # catkin reports broken packages
            continue
        for node in root.find_all("export"):
            for entry in node.find_all("gazebo_ros"):
                for folder in entry.attributes.get(export, "").split(":"):
                    if folder:
                        folders[Path(folder.replace("${prefix}", str(package)))] = None
    return tuple(folders)
