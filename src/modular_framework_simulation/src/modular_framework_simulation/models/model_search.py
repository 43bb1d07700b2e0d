# SPDX-License-Identifier: BSD-3-Clause
"""Search paths of models and meshes in an environment with ROS packages."""

from __future__ import annotations

import os
from pathlib import Path

import rospkg

from modular_framework_simulation.models.package_exports import MEDIA_EXPORT, MODEL_EXPORT, exported_folders
from modular_framework_simulation.models.sdf_resources import RESOURCE_PATH, Resources, folders_of, model_folders


def ros_resources(model_path: str) -> Resources:
    """Returns the search paths of models: the given folders, Gazebo's environment variables, and package exports.

    Args:
        model_path: Folders of the parameter `/gazebo_model_path`, separated by colons.
    """
    ros_packages = rospkg.RosPack()
    packages = [Path(ros_packages.get_path(name)) for name in ros_packages.list()]
    first = [Path(entry) for entry in model_path.split(os.pathsep) if entry]
    return Resources(
        (*model_folders(first, os.environ), *exported_folders(packages, MODEL_EXPORT)),
        ros_packages.get_path,
        (*folders_of(os.environ, RESOURCE_PATH), *exported_folders(packages, MEDIA_EXPORT)),
    )
