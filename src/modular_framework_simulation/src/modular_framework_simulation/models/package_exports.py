# SPDX-License-Identifier: BSD-3-Clause
"""Finds the folders of models and media that ROS packages export for Gazebo.

A package exports them in its package.xml, as gazebo_ros reads it:
`<export><gazebo_ros gazebo_model_path="${prefix}/models" gazebo_media_path="${prefix}"/></export>`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.xml_nodes import read_xml

MODEL_EXPORT, MEDIA_EXPORT = "gazebo_model_path", "gazebo_media_path"


def exported_folders(packages: Iterable[Path], export: str) -> tuple[Path, ...]:
    """Returns the folders that packages export.

    Args:
        packages: Folders of packages.
        export: Which of the two exports.
    """
    folders: dict[Path, None] = {}
    for package in packages:
        manifest = package / "package.xml"
        try:
            if export.encode() not in manifest.read_bytes():  # few do: the others need no parsing
                continue
            root = read_xml(manifest)
        except (OSError, DescriptionError):  # a broken package is for those to complain about who build it
            continue
        for node in root.find_all("export"):
            for entry in node.find_all("gazebo_ros"):
                for folder in entry.attributes.get(export, "").split(":"):
                    if folder:
                        folders[Path(folder.replace("${prefix}", str(package)))] = None
    return tuple(folders)
