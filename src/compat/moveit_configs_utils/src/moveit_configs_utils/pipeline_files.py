# SPDX-License-Identifier: BSD-3-Clause
"""Finds the planning pipelines of a config package and the packaged pipelines, and loads their parameters."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from launch_param_builder import ParameterFileError, load_yaml

from moveit_configs_utils.package_yaml import PackageYaml
from moveit_configs_utils.ros1_pipelines import KEYS_WITH_DEFAULTS, ros1_pipeline, with_missing_keys
from moveit_configs_utils.ros_launch_files import launch_file_parameters

LOGGER = logging.getLogger(__name__)
SUFFIX = "_planning.yaml"
OMPL = "ompl"


@dataclass(frozen=True, slots=True)
class PipelineFiles:
    """Locations of pipeline parameters.

    Attributes:
        package: Folder of the config package, with `config/<name>_planning.yaml`, and in MoveIt 1 packages also
            `launch/<name>_planning_pipeline.launch.xml`.
        defaults: Folder of the packaged pipelines.
        yaml: Loader of the package's YAML files.
    """

    package: Path
    defaults: Path
    yaml: PackageYaml

    def names(self, with_defaults: bool) -> list[str]:
        """Returns the pipelines with a YAML file in the package, followed by the packaged pipelines."""
        folders = [self.package / "config", *([self.defaults] if with_defaults else [])]
        files = [path for folder in folders for path in sorted(folder.glob(f"*{SUFFIX}"))]
        return list(dict.fromkeys(path.name.removesuffix(SUFFIX) for path in files))

    def load(self, names: Sequence[str], skip_invalid: bool) -> dict[str, dict[str, Any]]:
        """Returns the parameters of pipelines, by name.

        Args:
            names: Names of the pipelines.
            skip_invalid: Whether a pipeline without a planner is left out with a warning, instead of an error.

        Raises:
            ParameterFileError: A pipeline has no file or no planner.
        """
        pipelines = {name: self._load(name) for name in names}
        for name in [name for name, item in pipelines.items() if not item.get("planning_plugin")]:
            reason = (
                f"pipeline '{name}': no planning_plugin; looked in {', '.join(str(path) for path in self._files(name))}"
            )
            if not skip_invalid:
                raise ParameterFileError(reason)
            LOGGER.warning("%s; the pipeline is left out", reason)
            del pipelines[name]
        return pipelines

    def _files(self, name: str) -> tuple[Path, Path, Path]:
        return (
            self.package / "config" / f"{name}{SUFFIX}",
            self.package / "launch" / f"{name}_planning_pipeline.launch.xml",
            self.defaults / f"{name}{SUFFIX}",
        )

    def _load(self, name: str) -> dict[str, Any]:
        own, launch_file, default = self._files(name)
        found: dict[str, Any] = {}
        if own.is_file():
            found = ros1_pipeline(self.yaml.load(own), own)
        if "planning_plugin" not in found and launch_file.is_file():
            parameters = launch_file_parameters(launch_file, self.yaml.values())
            found = with_missing_keys(found, ros1_pipeline(parameters, launch_file), ())
        if default.is_file():
            found = with_missing_keys(
                found, ros1_pipeline(load_yaml(default), default), KEYS_WITH_DEFAULTS if found else ()
            )
        if name == OMPL and "planner_configs" not in found:
            found = with_missing_keys(found, load_yaml(self.defaults / "ompl_defaults.yaml"), ())
        return found
