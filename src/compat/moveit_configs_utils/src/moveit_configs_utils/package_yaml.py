# SPDX-License-Identifier: BSD-3-Clause
"""Loads YAML files of a config package, with `$(arg NAME)` replaced as by the package's launch files.

MoveIt 1 packages may use `$(arg arm_id)_joint1` in YAML files, which their launch files load with `subst_value="true"`.
The launch files define the defaults of the arguments.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from launch_param_builder import load_file, parse_parameters

from modular_framework_urdf.launch_arguments import ARGUMENT, launch_files, xacro_arguments
from modular_framework_urdf.xml_text import Element, XmlError, parse

LOGGER = logging.getLogger(__name__)


@dataclass(slots=True)
class PackageYaml:
    """Loads YAML files.

    Attributes:
        package: Folder of the config package.
        arguments: Values that override the defaults in the launch files.
    """

    package: Path
    arguments: dict[str, str] = field(default_factory=dict)

    def load(self, path: Path) -> dict[str, Any]:
        """Returns the parameters in a file.

        Arguments without a value are kept, with a warning.

        Raises:
            ParameterBuilderFileNotFoundError: The file does not exist.
            ParameterFileError: The file is not valid YAML or not a mapping.
        """
        text = load_file(path)
        if ARGUMENT.search(text):
            values = self.values()
            unknown = sorted({name for name in ARGUMENT.findall(text) if name not in values})
            if unknown:
                LOGGER.warning(
                    "%s: no value for %s (xacro arguments, defaults of launch/*); the placeholder is kept",
                    path,
                    ", ".join(f"$(arg {name})" for name in unknown),
                )
            text = ARGUMENT.sub(lambda match: values.get(match[1], match[0]), text)
        return parse_parameters(text, path)

    def values(self) -> dict[str, str]:
        """Returns the values of arguments: given values, and plain defaults in the package's launch files."""
        result = dict(self.arguments)
        for root in self._roots_of_launch_files():
            for argument in root.findall("arg"):
                name, default = argument.get("name"), argument.get("default")
                if name and default is not None and "$(" not in default:
                    result.setdefault(name, default)
        return {"fake_execution_type": "interpolate", **result}

    def xacro_arguments(self, file_name: str) -> dict[str, str]:
        """Returns the arguments of a xacro file in the package's launch files."""
        return xacro_arguments(self._roots_of_launch_files(), file_name, self.values())

    def _roots_of_launch_files(self) -> Iterator[Element]:
        for path in launch_files(self.package):
            try:
                yield parse(path.read_bytes(), str(path))
            except (XmlError, OSError) as error:
                LOGGER.warning("%s: the defaults of its arguments are unknown: %s", path, error)
