# SPDX-License-Identifier: BSD-3-Clause
"""Builder that collects parameters from the files of a package."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from launch_param_builder.utils import ParameterValueType, load_file, load_xacro, load_yaml, package_folder


class ParameterBuilder:
    """Collects parameters; all methods except `to_dict` return the builder, so that calls can be chained.

    File paths are absolute or relative to the package.
    """

    def __init__(self, package_name: str) -> None:
        """Finds the package.

        Args:
            package_name: ROS package whose files are loaded.

        Raises:
            ParameterFileError: The package is not on ROS_PACKAGE_PATH.
        """
        self._package_path: Path = package_folder(package_name)
        self._parameters: dict[str, Any] = {}

    def yaml(self, file_path: Path | str, parameter_namespace: str | None = None) -> Self:
        """Adds the parameters of a YAML file, optionally below a namespace."""
        content = load_yaml(self._package_path / file_path)
        if parameter_namespace:
            self._parameters.setdefault(parameter_namespace, {}).update(content)
        else:
            self._parameters.update(content)
        return self

    def file_parameter(self, parameter_name: str, file_path: Path | str) -> Self:
        """Adds a parameter with the text of a file."""
        return self.parameter(parameter_name, load_file(self._package_path / file_path))

    def xacro_parameter(
        self, parameter_name: str, file_path: Path | str, mappings: Mapping[str, Any] | None = None
    ) -> Self:
        """Adds a parameter whose value is the expanded text of a xacro file.

        Args:
            parameter_name: Name of the parameter.
            file_path: xacro file, relative to the package.
            mappings: Arguments of the xacro file.
        """
        return self.parameter(parameter_name, load_xacro(self._package_path / file_path, mappings))

    def parameter(self, parameter_name: str, parameter_value: ParameterValueType) -> Self:
        """Adds a parameter."""
        self._parameters[parameter_name] = parameter_value
        return self

    def path_parameter(self, parameter_name: str, file_path: Path | str) -> Self:
        """Adds a parameter with the absolute path of a file of the package."""
        return self.parameter(parameter_name, str(self._package_path / file_path))

    def to_dict(self) -> dict[str, Any]:
        """Returns the parameters collected so far."""
        return self._parameters
