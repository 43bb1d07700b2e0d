# SPDX-License-Identifier: BSD-3-Clause
"""Reads `.setup_assistant`, which names the URDF and SRDF of a config package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from launch_param_builder import ParameterFileError, load_yaml

from modular_framework_urdf.launch_arguments import UNKNOWN, command_words, known_arguments

FILE_NAME = ".setup_assistant"


@dataclass(frozen=True, slots=True)
class SetupAssistantFile:
    """Contents of the file; all values are optional.

    Attributes:
        urdf_package: ROS package of the URDF; empty for a file outside of packages.
        urdf_path: Path of the URDF in the package; absolute without a package.
        xacro_arguments: Arguments of the URDF's xacro file.
        srdf_path: Path of the SRDF in the config package.
    """

    urdf_package: str = ""
    urdf_path: str = ""
    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    srdf_path: str = ""


def read_setup_assistant_file(package_path: Path, values: Mapping[str, str]) -> SetupAssistantFile:
    """Reads the file of a config package; returns an empty result if the file does not exist.

    Args:
        package_path: Folder of the package.
        values: Values of the arguments of the package's launch files, for `$(arg NAME)`.

    Raises:
        ParameterFileError: The file does not have the format of the Setup Assistant.
    """
    path = package_path / FILE_NAME
    if not path.exists():
        return SetupAssistantFile()
    config = _section(load_yaml(path), "moveit_setup_assistant_config", path)
    urdf, srdf = (_section(config, key if key in config else key.upper(), path) for key in ("urdf", "srdf"))
    if urdf and not urdf.get("relative_path"):
        raise ParameterFileError(f"{path}: section urdf has {', '.join(urdf)}; expected package and relative_path")
    return SetupAssistantFile(
        str(urdf.get("package", "")),
        _relative(urdf) if urdf.get("package") else str(urdf.get("relative_path", "")),
        _arguments(str(urdf.get("xacro_args", "")), values, path),
        _relative(srdf),
    )


def _section(content: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Any]:
    section = content.get(key, {})
    if not isinstance(section, Mapping):
        raise ParameterFileError(f"{path}: {key} is {section!r}; expected a mapping")
    return section


def _relative(section: Mapping[str, Any]) -> str:
    return str(section.get("relative_path", "")).lstrip("/")


def _arguments(text: str, values: Mapping[str, str], path: Path) -> dict[str, str]:
    """Parses `name:=value name:=value`; options of the xacro command such as --inorder have no effect.

    An argument with an unknown value, such as an undefined `$(arg NAME)`, keeps the default of the xacro file.
    """
    words = command_words(text, values)
    wrong = [word for word in words if ":=" not in word and UNKNOWN not in word and not word.startswith("-")]
    if wrong:
        raise ParameterFileError(
            f"{path}: xacro_args has '{' '.join(wrong)}'; expected arguments name:=value, separated by spaces"
        )
    return known_arguments(words)
