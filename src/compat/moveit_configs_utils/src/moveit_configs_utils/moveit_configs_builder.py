# SPDX-License-Identifier: BSD-3-Clause
"""Loads a config package in the Setup Assistant's layout step by step, as MoveIt 2's builder for ROS 1.

    moveit_config = (
        MoveItConfigsBuilder("my_robot", package_name="my_robot_moveit_config")
        .robot_description(mappings={"use_fake_hardware": "true"})
        .planning_pipelines(pipelines=["ompl", "stomp"])
        .to_moveit_configs()
    )
    parameters = moveit_config.to_dict()

Parameters without a step are loaded from the Setup Assistant's default file; the package's README lists the files.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from launch_param_builder import (
    ParameterBuilder,
    ParameterBuilderFileNotFoundError,
    load_xacro,
    package_folder,
    raise_if_file_not_found,
)

from moveit_configs_utils.moveit_configs import MoveItConfigs
from moveit_configs_utils.package_yaml import PackageYaml
from moveit_configs_utils.pipeline_files import OMPL, PipelineFiles
from moveit_configs_utils.ros1_controllers import choose_controllers_file, ros1_controllers
from moveit_configs_utils.ros1_sensors import ros1_sensors
from moveit_configs_utils.setup_assistant_file import FILE_NAME, read_setup_assistant_file

LOGGER = logging.getLogger(__name__)
CONFIG = Path("config")
PILZ = "pilz_industrial_motion_planner"
Mappings = Mapping[Any, Any]


class MoveItConfigsBuilder(ParameterBuilder):
    """Collects the parameters of a robot; every step returns the builder.

    File paths are absolute or relative to the config package.
    """

    def __init__(
        self, robot_name: str, robot_description: str = "robot_description", package_name: str | None = None
    ) -> None:
        """Finds the config package and the robot's URDF and SRDF.

        Args:
            robot_name: Name of the robot; the package is `<robot_name>_moveit_config`, with files of this name.
            robot_description: Parameter of the URDF, and prefix of the other parameters.
            package_name: Name of the config package, if different.

        Raises:
            ParameterFileError: The package is not found, or its `.setup_assistant` cannot be read.
        """
        super().__init__(package_name or f"{robot_name}_moveit_config")
        self._robot_name = robot_name
        self._description = robot_description
        self._configs = MoveItConfigs(package_path=self._package_path)
        self._yaml = PackageYaml(self._package_path)
        self._setup = read_setup_assistant_file(self._package_path, self._yaml.values())
        self._yaml.arguments.update(self._setup.xacro_arguments)
        own = CONFIG / f"{robot_name}.urdf.xacro"
        self._own_urdf: Path | None = own if (self._package_path / own).is_file() else None
        if self._own_urdf is None and not self._setup.urdf_path:
            self._own_urdf = self._expected_path(f"{robot_name}.urdf", "URDF", own)
        self._srdf = Path(self._setup.srdf_path or self._expected_path(f"{robot_name}.srdf", "SRDF"))
        self._urdf_mappings: dict[Any, Any] = {}

    def _expected_path(self, name: str, kind: str, looked_for: Path | None = None) -> Path:
        """Returns the expected path of a file that is not named anywhere, and logs the searched locations."""
        places = [*([str(looked_for)] if looked_for else []), f"section {kind} of {FILE_NAME}"]
        LOGGER.warning(
            "%s: no %s found (looked for %s); using %s", self._package_path, kind, " and ".join(places), CONFIG / name
        )
        return CONFIG / name

    def robot_description(self, file_path: Path | str | None = None, mappings: Mappings | None = None) -> Self:
        """Loads the URDF.

        If the file does not exist, a warning is logged, and another node must set the description.

        Args:
            file_path: Path of the file; by default `config/<robot_name>.urdf.xacro` or the file in `.setup_assistant`.
            mappings: Values of the xacro arguments, as texts or launch substitutions; by default `xacro_args` of
                `.setup_assistant`.

        Raises:
            ParameterFileError: The package of the URDF is not found, or xacro cannot expand the file.
        """
        if file_path is not None:
            path = self._package_path / file_path
        elif self._own_urdf is not None:
            path = self._package_path / self._own_urdf
        else:
            package = self._setup.urdf_package
            path = (package_folder(package) if package else self._package_path) / self._setup.urdf_path
        self._urdf_mappings = _texts(mappings or {})
        arguments = self._urdf_mappings or dict(self._setup.xacro_arguments)
        self._yaml.arguments.update(_known_texts(arguments))
        try:
            text = _expanded_xacro(path, arguments)
        except ParameterBuilderFileNotFoundError as error:
            LOGGER.warning(
                "%s; the robot description is not loaded: another node has to set the parameter %s",
                error,
                self._description,
            )
        else:
            self._configs.robot_description = {self._description: text}
        return self

    def robot_description_semantic(self, file_path: Path | str | None = None, mappings: Mappings | None = None) -> Self:
        """Loads the SRDF.

        Args:
            file_path: Path of the file; by default the file in `.setup_assistant`.
            mappings: Values of the xacro arguments; by default the values of a previous step `robot_description`, or
                otherwise the values in the package's launch files and `xacro_args` of `.setup_assistant`.

        Raises:
            ParameterBuilderFileNotFoundError: The file does not exist.
            ParameterFileError: xacro cannot expand the file.
        """
        path = self._package_path / file_path if file_path else _existing_or_xacro(self._package_path / self._srdf)
        arguments = _texts(mappings or {}) or _known_texts(self._urdf_mappings)
        if not mappings and not self._urdf_mappings:
            arguments = {**self._yaml.xacro_arguments(path.name), **self._setup.xacro_arguments}
        self._configs.robot_description_semantic = {f"{self._description}_semantic": _expanded_xacro(path, arguments)}
        return self

    def robot_description_kinematics(self, file_path: Path | str | None = None) -> Self:
        """Loads the settings of the kinematics solvers, by default `config/kinematics.yaml`."""
        content = self._content(file_path, "kinematics.yaml")
        self._configs.robot_description_kinematics = {f"{self._description}_kinematics": content}
        return self

    def joint_limits(self, file_path: Path | str | None = None) -> Self:
        """Loads the joint limits for planning, by default `config/joint_limits.yaml`."""
        self._configs.joint_limits = {f"{self._description}_planning": self._content(file_path, "joint_limits.yaml")}
        return self

    def moveit_cpp(self, file_path: Path | str | None = None) -> Self:
        """Loads the parameters of MoveItCpp, by default `config/moveit_cpp.yaml`."""
        self._configs.moveit_cpp = self._content(file_path, "moveit_cpp.yaml")
        return self

    def trajectory_execution(self, file_path: Path | str | None = None, moveit_manage_controllers: bool = True) -> Self:
        """Loads the controllers that execute motions.

        Args:
            file_path: Path of the file; by default the result of `choose_controllers_file`.
            moveit_manage_controllers: Whether move_group may start and stop controllers as needed for a motion.

        Raises:
            ParameterBuilderFileNotFoundError: The file does not exist.
            ParameterFileError: The file is invalid.
            RuntimeError: The file is ambiguous.
        """
        path = (
            choose_controllers_file(self._package_path / CONFIG, self._robot_name, self._yaml.load)
            if file_path is None
            else self._package_path / file_path
        )
        found = ros1_controllers(self._yaml.load(path), path) if path else {}
        self._configs.trajectory_execution = {"moveit_manage_controllers": moveit_manage_controllers, **found}
        return self

    def planning_scene_monitor(
        self,
        publish_planning_scene: bool = True,
        publish_geometry_updates: bool = True,
        publish_state_updates: bool = True,
        publish_transforms_updates: bool = True,
        publish_robot_description: bool = False,
        publish_robot_description_semantic: bool = False,
    ) -> Self:
        """Sets which parts of the planning scene move_group publishes, optionally with the robot's descriptions.

        Args:
            publish_planning_scene: Whether to publish changes of the planning scene.
            publish_geometry_updates: Whether to publish changes of objects and the octomap.
            publish_state_updates: Whether to publish changes of the robot's state.
            publish_transforms_updates: Whether to publish changes of fixed transforms.
            publish_robot_description: Whether to publish the URDF as a topic.
            publish_robot_description_semantic: Whether to publish the SRDF as a topic.
        """
        self._configs.planning_scene_monitor = {
            "planning_scene_monitor": {
                "publish_planning_scene": publish_planning_scene,
                "publish_geometry_updates": publish_geometry_updates,
                "publish_state_updates": publish_state_updates,
                "publish_transforms_updates": publish_transforms_updates,
                "publish_robot_description": publish_robot_description,
                "publish_robot_description_semantic": publish_robot_description_semantic,
            }
        }
        return self

    def sensors_3d(self, file_path: Path | str | None = None) -> Self:
        """Loads the sensors of the octomap, by default `config/sensors_3d.yaml`, unless the first sensor is empty."""
        path = self._package_path / (file_path or CONFIG / "sensors_3d.yaml")
        if file_path is not None:
            raise_if_file_not_found(path)
        self._configs.sensors_3d = ros1_sensors(self._yaml.load(path), path) if path.is_file() else {}
        return self

    def planning_pipelines(
        self,
        default_planning_pipeline: str | None = None,
        pipelines: Sequence[str] | None = None,
        load_all: bool = True,
    ) -> Self:
        """Loads planning pipelines.

        Args:
            default_planning_pipeline: Pipeline of requests without a pipeline; by default `ompl`, or else the first.
            pipelines: Names of the pipelines; None for every `config/*_planning.yaml`.
            load_all: Whether to add the packaged pipelines if `pipelines` is None.

        Raises:
            RuntimeError: The default pipeline is not loaded.
            ParameterFileError: A pipeline has no file or no planner.
        """
        defaults = package_folder("moveit_configs_utils") / "default_configs"
        files = PipelineFiles(self._package_path, defaults, self._yaml)
        loaded = files.load(files.names(load_all) if pipelines is None else pipelines, skip_invalid=pipelines is None)
        default = default_planning_pipeline or (OMPL if OMPL in loaded else next(iter(loaded), ""))
        if default not in loaded:
            raise RuntimeError(
                f"default_planning_pipeline: `{default}` doesn't name any of the input pipelines `{','.join(loaded)}`"
            )
        self._configs.planning_pipelines = {"planning_pipelines": loaded, "default_planning_pipeline": default}
        return self

    def pilz_cartesian_limits(self, file_path: Path | str | None = None) -> Self:
        """Loads limits of the tool along lines and arcs, by default `config/pilz_cartesian_limits.yaml`.

        If this file is missing, `config/cartesian_limits.yaml`, its name in MoveIt 1, is loaded with a warning.
        """
        old = CONFIG / "cartesian_limits.yaml"
        if (self._package_path / old).is_file():
            LOGGER.warning("%s is deprecated, please rename to pilz_cartesian_limits.yaml", self._package_path / old)
            if file_path is None and not (self._package_path / CONFIG / "pilz_cartesian_limits.yaml").is_file():
                file_path = old
        content = self._content(file_path, "pilz_cartesian_limits.yaml")
        self._configs.pilz_cartesian_limits = {f"{self._description}_planning": content}
        return self

    def to_moveit_configs(self) -> MoveItConfigs:
        """Returns all parameters, after loading the missing parts; moveit_cpp is only loaded by its step.

        Raises:
            ParameterBuilderFileNotFoundError: The SRDF does not exist.
            ParameterFileError: A file is invalid.
            RuntimeError: The controller file is ambiguous.
        """
        configs = self._configs
        self._load_missing("robot_description", "robot_description_semantic")
        if not configs.robot_description_kinematics:
            _if_present(self.robot_description_kinematics, "no inverse kinematics: only joint goals are possible")
        self._load_missing("planning_pipelines", "trajectory_execution", "planning_scene_monitor", "sensors_3d")
        if not configs.joint_limits:
            _if_present(self.joint_limits, "only the limits of the URDF apply")
        if PILZ in configs.planning_pipelines["planning_pipelines"] and not configs.pilz_cartesian_limits:
            _if_present(self.pilz_cartesian_limits, "LIN and CIRC cannot be planned")
        return configs

    def to_dict(self, include_moveit_configs: bool = True) -> dict[str, Any]:
        """Returns all parameters as one dictionary.

        Args:
            include_moveit_configs: False for only the parameters of ParameterBuilder's steps.
        """
        own = super().to_dict()
        return {**own, **self.to_moveit_configs().to_dict()} if include_moveit_configs else own

    def _load_missing(self, *parts: str) -> None:
        """Runs the steps of missing parts in this order; a part and its step have the same name."""
        for part in parts:
            if not getattr(self._configs, part):
                getattr(self, part)()

    def _content(self, file_path: Path | str | None, name: str) -> dict[str, Any]:
        return self._yaml.load(self._package_path / (file_path or CONFIG / name))


def _if_present(load: Callable[[], object], consequence: str) -> None:
    """Loads an optional file; if missing, a warning with the consequence is logged."""
    try:
        load()
    except ParameterBuilderFileNotFoundError as error:
        LOGGER.warning("%s; %s", error, consequence)


def _expanded_xacro(path: Path, mappings: Mappings) -> Any:
    """Returns the expanded text of a xacro file, or a value that is expanded during the launch.

    The expansion is deferred if an argument is a launch substitution.

    Raises:
        ParameterBuilderFileNotFoundError: The file does not exist.
        ParameterFileError: xacro cannot expand the file.
    """
    raise_if_file_not_found(path)
    if all(isinstance(item, str) for pair in mappings.items() for item in pair):
        return load_xacro(path, mappings)
    from launch_ros.parameter_descriptions import ParameterValue

    from moveit_configs_utils.substitutions import Xacro

    return ParameterValue(Xacro(str(path), mappings=mappings), value_type=str)


def _existing_or_xacro(path: Path) -> Path:
    """Returns the file, or, with a warning, the xacro file of the same name if the file is missing."""
    xacro_file = path.with_name(f"{path.name}.xacro")
    if path.is_file() or not xacro_file.is_file():
        return path
    LOGGER.warning("File %s doesn't exist; using %s", path, xacro_file)
    return xacro_file


def _texts(mappings: Mappings) -> dict[Any, Any]:
    return {_text(name): _text(value) for name, value in mappings.items()}


def _known_texts(mappings: Mappings) -> dict[str, str]:
    """Returns the entries that are known before the launch."""
    return {name: value for name, value in mappings.items() if isinstance(name, str) and isinstance(value, str)}


def _text(value: Any) -> Any:
    """Converts a plain value to a text for a launch file; substitutions are not changed."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int | float | Path) else value
