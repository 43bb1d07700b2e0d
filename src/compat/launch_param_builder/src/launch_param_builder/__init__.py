# SPDX-License-Identifier: BSD-3-Clause
"""Builder of launch parameters from the files of a package, with the names of ROS 2's launch_param_builder."""

from launch_param_builder.launch_param_builder import ParameterBuilder
from launch_param_builder.utils import (
    ParameterBuilderFileNotFoundError,
    ParameterFileError,
    ParameterValueType,
    get_path,
    load_file,
    load_xacro,
    load_yaml,
    package_folder,
    parse_parameters,
    raise_if_file_not_found,
)

__all__ = [
    "ParameterBuilder",
    "ParameterBuilderFileNotFoundError",
    "ParameterFileError",
    "ParameterValueType",
    "get_path",
    "load_file",
    "load_xacro",
    "load_yaml",
    "package_folder",
    "parse_parameters",
    "raise_if_file_not_found",
]
