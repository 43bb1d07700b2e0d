# SPDX-License-Identifier: BSD-3-Clause
"""Loads a config package in the Setup Assistant's layout, step by step: MoveIt 2's builder for ROS 1.

    moveit_config = (
        MoveItConfigsBuilder("my_robot", package_name="my_robot_moveit_config")
        .robot_description(mappings={"use_fake_hardware": "true"})
        .planning_pipelines(pipelines=["ompl", "stomp"])
        .to_moveit_configs()
    )
    parameters = moveit_config.to_dict()

What no step asks for is loaded from the file where the Setup Assistant puts it; the package's README lists the files.
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
            robot_name: the package is `<robot_name>_moveit_config`, and files of this name are looked for in it.
            robot_description: parameter of the URDF; the others are called after it.
            package_name: the config package, if it has another name.

        Raises:
            ParameterFileError: the package is not found, or its `.setup_assistant` cannot be read.
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
            self._own_urdf = self._guessed(f"{robot_name}.urdf", "URDF", own)
        self._srdf = Path(self._setup.srdf_path or self._guessed(f"{robot_name}.srdf", "SRDF"))
        self._urdf_mappings: dict[Any, Any] = {}

    def _guessed(self, name: str, kind: str, looked_for: Path | None = None) -> Path:
        """Returns where a file is expected that nothing names, and warns where its name was looked for."""
        places = [*([str(looked_for)] if looked_for else []), f"section {kind} of {FILE_NAME}"]
        LOGGER.warning(
            "%s: no %s found (looked for %s); using %s", self._package_path, kind, " and ".join(places), CONFIG / name
        )
        return CONFIG / name

    def robot_description(self, file_path: Path | str | None = None, mappings: Mappings | None = None) -> Self:
        """Loads the URDF.

        Args:
            file_path: another one than `config/<robot_name>.urdf.xacro` or the one `.setup_assistant` names.
            mappings: values of the xacro arguments, texts or launch substitutions; without any, `xacro_args` of
                `.setup_assistant`.

        A file that does not exist is a warning: the description is then expected from another source.

        Raises:
            ParameterFileError: the package of the URDF is not found, or xacro cannot expand the file.
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
            text = _expanded(path, arguments)
        except ParameterBuilderFileNotFoundError as error:
            LOGGER.warning(
                "%s; the robot description is not loaded: somebody else has to set the parameter %s",
                error,
                self._description,
            )
        else:
            self._configs.robot_description = {self._description: text}
        return self

    def robot_description_semantic(self, file_path: Path | str | None = None, mappings: Mappings | None = None) -> Self:
        """Loads the SRDF.

        Args:
            file_path: another one than `.setup_assistant` names.
            mappings: values of the xacro arguments; without any, those that `robot_description` was given before, or
                else those of the package's launch files and `xacro_args` of `.setup_assistant`.

        Raises:
            ParameterBuilderFileNotFoundError: there is no such file.
            ParameterFileError: xacro cannot expand it.
        """
        path = self._package_path / file_path if file_path else _or_its_xacro(self._package_path / self._srdf)
        arguments = _texts(mappings or {}) or _known_texts(self._urdf_mappings)
        if not mappings and not self._urdf_mappings:
            arguments = {**self._yaml.xacro_arguments(path.name), **self._setup.xacro_arguments}
        self._configs.robot_description_semantic = {f"{self._description}_semantic": _expanded(path, arguments)}
        return self

    def robot_description_kinematics(self, file_path: Path | str | None = None) -> Self:
        """Loads the settings of inverse kinematics: `config/kinematics.yaml`."""
        content = self._content(file_path, "kinematics.yaml")
        self._configs.robot_description_kinematics = {f"{self._description}_kinematics": content}
        return self

    def joint_limits(self, file_path: Path | str | None = None) -> Self:
        """Loads the limits for planning: `config/joint_limits.yaml`."""
        self._configs.joint_limits = {f"{self._description}_planning": self._content(file_path, "joint_limits.yaml")}
        return self

    def moveit_cpp(self, file_path: Path | str | None = None) -> Self:
        """Loads parameters of MoveItCpp: `config/moveit_cpp.yaml`."""
        self._configs.moveit_cpp = self._content(file_path, "moveit_cpp.yaml")
        return self

    def trajectory_execution(self, file_path: Path | str | None = None, moveit_manage_controllers: bool = True) -> Self:
        """Loads the controllers that execute motions.

        Args:
            file_path: their file; without one, see `choose_controllers_file`.
            moveit_manage_controllers: whether controllers may be started and stopped as motions need them.

        Raises:
            ParameterBuilderFileNotFoundError: there is no such file.
            ParameterFileError: the file cannot be used.
            RuntimeError: several files might be meant.
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
        """Sets which parts of the planning scene move_group publishes.

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
        """Loads the octomap's sensors: `config/sensors_3d.yaml`, if it exists and its first sensor is not empty."""
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
            default_planning_pipeline: the one of requests that name none; without it `ompl`, or else the first.
            pipelines: their names; None: every `config/*_planning.yaml`.
            load_all: with None, the packaged pipelines as well.

        Raises:
            RuntimeError: the default is none of them.
            ParameterFileError: a pipeline has no file or no planner.
        """
        defaults = package_folder("moveit_configs_utils") / "default_configs"
        files = PipelineFiles(self._package_path, defaults, self._yaml)
        loaded = files.load(files.names(load_all) if pipelines is None else pipelines, leave_out=pipelines is None)
        default = default_planning_pipeline or (OMPL if OMPL in loaded else next(iter(loaded), ""))
        if default not in loaded:
            raise RuntimeError(
                f"default_planning_pipeline: `{default}` doesn't name any of the input pipelines `{','.join(loaded)}`"
            )
        self._configs.planning_pipelines = {"planning_pipelines": loaded, "default_planning_pipeline": default}
        return self

    def pilz_cartesian_limits(self, file_path: Path | str | None = None) -> Self:
        """Loads limits of the tool along lines and arcs: `config/pilz_cartesian_limits.yaml`.

        `config/cartesian_limits.yaml`, its name in MoveIt 1, is taken, with a warning, where there is no other.
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
        """Returns everything, after loading what no step has loaded; moveit_cpp is loaded by its step only.

        Raises:
            ParameterBuilderFileNotFoundError: the SRDF does not exist.
            ParameterFileError: a file cannot be used.
            RuntimeError: several files of controllers might be meant.
        """
        configs = self._configs
        self._load_missing("robot_description", "robot_description_semantic")
        if not configs.robot_description_kinematics:
            _if_present(self.robot_description_kinematics, "no inverse kinematics: goals can be given for joints only")
        self._load_missing("planning_pipelines", "trajectory_execution", "planning_scene_monitor", "sensors_3d")
        if not configs.joint_limits:
            _if_present(self.joint_limits, "the limits of the URDF alone count")
        if PILZ in configs.planning_pipelines["planning_pipelines"] and not configs.pilz_cartesian_limits:
            _if_present(self.pilz_cartesian_limits, "LIN and CIRC cannot be planned")
        return configs

    def to_dict(self, include_moveit_configs: bool = True) -> dict[str, Any]:
        """Returns all parameters as one dictionary.

        Args:
            include_moveit_configs: False leaves those of ParameterBuilder's own steps.
        """
        own = super().to_dict()
        return {**own, **self.to_moveit_configs().to_dict()} if include_moveit_configs else own

    def _load_missing(self, *parts: str) -> None:
        """Takes the steps, in this order, of the parts that no step has loaded; part and step have the same name."""
        for part in parts:
            if not getattr(self._configs, part):
                getattr(self, part)()

    def _content(self, file_path: Path | str | None, name: str) -> dict[str, Any]:
        return self._yaml.load(self._package_path / (file_path or CONFIG / name))


def _if_present(load: Callable[[], object], consequence: str) -> None:
    """Loads a file that a robot can do without; where it does not exist, a warning says what follows from that."""
    try:
        load()
    except ParameterBuilderFileNotFoundError as error:
        LOGGER.warning("%s; %s", error, consequence)


def _expanded(path: Path, mappings: Mappings) -> Any:
    """Returns what a xacro file expands to; something that expands it at launch, where an argument is known only then.

    Raises:
        ParameterBuilderFileNotFoundError: there is no such file.
        ParameterFileError: xacro cannot expand it.
    """
    raise_if_file_not_found(path)
    if all(isinstance(item, str) for pair in mappings.items() for item in pair):
        return load_xacro(path, mappings)
    from launch_ros.parameter_descriptions import ParameterValue

    from moveit_configs_utils.substitutions import Xacro

    return ParameterValue(Xacro(str(path), mappings=mappings), value_type=str)


def _or_its_xacro(path: Path) -> Path:
    """Returns a file; where it does not exist the xacro file it is made from, with a warning, if that one does."""
    xacro_file = path.with_name(f"{path.name}.xacro")
    if path.is_file() or not xacro_file.is_file():
        return path
    LOGGER.warning("File %s doesn't exist; using %s", path, xacro_file)
    return xacro_file


def _texts(mappings: Mappings) -> dict[Any, Any]:
    return {_text(name): _text(value) for name, value in mappings.items()}


def _known_texts(mappings: Mappings) -> dict[str, str]:
    """Returns the entries that are known before the launch file runs."""
    return {name: value for name, value in mappings.items() if isinstance(name, str) and isinstance(value, str)}


def _text(value: Any) -> Any:
    """Returns a plain value as text, as a launch file writes it, and a substitution as it is."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int | float | Path) else value
