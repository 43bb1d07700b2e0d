# SPDX-License-Identifier: BSD-3-Clause
"""Checks the values of the framework's launch arguments: packages, files and numbers.

roslaunch reports such faults one node at a time, without the argument and the allowed values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import roslaunch.loader
import rospkg
import yaml

from modular_framework_core.files import default_folders, located_yaml, shallow_yaml
from modular_framework_core.files.atomic_files import read_text
from modular_framework_core.files.faults import FaultList, TaskFault
from modular_framework_core.task_constructor.header_fields import module_name_fault
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_ros.parameter_declarations import node_declaration
from modular_framework_urdf import xml_text

METHOD, CONFIGURATION, GENERATED_NAME = "method_launch_file", "config_directory", "generated_state_machine_name"
NO_METHOD = ("", "none")
"""Values of METHOD that start no method; roslaunch ignores an argument with an empty value."""
PACKAGES = ("description_package", "robot_package", "moveit_config_package")
ROBOT_FILES = (("robot_urdf_file", "robot_package", "urdf"), ("controller_file", "robot_package", "controllers"))
WORLD_FILE, SCENE_FILE = (
    ("world_file", "description_package", "worlds"),
    ("scene_file", "description_package", "scenes"),
)
CONFIGURATION_FILES = (
    "sensors_config.yaml",
    "motion_planner_config.yaml",
    "generative_methods_config.yaml",
    "manipulator_controller_parameters.yaml",
)
"""Required files of the configuration folder."""
CONNECTION_FILE, OCTOMAP_FILE = "external_manipulator_connection.yaml", "sensor_plugins.yaml"
"""Files of the configuration folder that only a real robot and only an octomap require."""
VENDOR_DRIVER_FILE = "vendor_driver_file"
"""Argument with the configuration of a vendor's driver."""
NAMES_FILES = ("named_joint_states.yaml", "named_trajectories.yaml", "named_poses.yaml")
"""Optional files of the configuration folder."""
PORTS = {
    "viewer_port": ("modular_framework_simulation", "viewer"),
    "ui_port": ("modular_framework_ui", "page"),
}
"""Package and name of the node whose parameter `~port` an argument sets. The node may not be part of the launch."""
SCRIPT, MACHINE, REGIONS = "task_constructor_script", "state_machine_to_load", "regions"


def value_faults(values: Mapping[str, str]) -> list[str]:
    """Returns the faults in the values of launch arguments, one sentence each.

    Args:
        values: Values by argument name. Packages, their files and numbers are checked only if `robot_package` is given.
    """
    return [
        *_truth_faults(values),
        *_region_faults(values),
        *file_faults(values),
        *(_number_faults(values) if "robot_package" in values else ()),
    ]


def file_faults(values: Mapping[str, str]) -> list[str]:
    """Returns the faults of missing or unreadable packages, files and tasks; see `value_faults`."""
    faults = [
        *_method_faults(values.get(METHOD, "")),
        *_folder_faults(values),
        *_task_faults(values),
        *_generated_name_faults(values),
        *_port_faults(values),
    ]
    return [*faults, *(_package_faults(values) if "robot_package" in values else ())]


def _truth_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields a fault if roslaunch cannot read `simulation` as a bool."""
    value = values.get("simulation", "true")
    if value.lower() not in ("true", "false", "1", "0"):
        yield f"argument 'simulation' is '{value}'; it must be true or false"


def _region_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields the fault of regions that are not valid YAML; the regions themselves are checked with the names."""
    value = values.get(REGIONS, "")
    try:
        shallow_yaml.load(value)
    except (ValueError, yaml.YAMLError, RecursionError) as error:
        problem = getattr(error, "problem", None) or error
        yield (
            f"argument '{REGIONS}' is '{value}', which is not valid YAML: {problem}; allowed: regions such as "
            "{NAME: {x: [0.1, 0.2], y: [0.4, 0.5]}}"
        )


def _number_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields faults of numbers and choices that the simulation does not accept."""
    declared = node_declaration("modular_framework_simulation", "simulation")
    for name, item in (declared.parameters if declared else {}).items():
        argument = name.lstrip("~/")
        if (item.type in ("int", "float") or item.choices) and values.get(argument, "") != "":
            fault = item.fault(roslaunch.loader.convert_value(values[argument], "auto"))
            if fault:
                yield f"argument '{argument}' {fault}"


def _port_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields the faults of port numbers."""
    for argument, node in PORTS.items():
        declared = node_declaration(*node)
        if declared is not None and values.get(argument, "") != "":
            fault = declared.parameters["~port"].fault(roslaunch.loader.convert_value(values[argument], "auto"))
            if fault:
                yield f"argument '{argument}' {fault}"


def _package_faults(values: Mapping[str, str]) -> Iterator[str]:
    finder = rospkg.RosPack.get_instance()
    folders: dict[str, str] = {}
    for name in PACKAGES:
        package = values.get(name, "")
        try:
            folders[name] = finder.get_path(package)
        except rospkg.ResourceNotFound:
            yield (
                f"argument '{name}' is '{package}', and there is no such package; correct it, or build and source the "
                f"workspace with the package{nearest(package, finder.list())}"
            )
    simulated = values.get("simulation", "").lower() in ("true", "1")
    environment = (WORLD_FILE,) if simulated else (SCENE_FILE,) if values.get("scene_file") else ()
    has_vendor_driver = bool(values.get(VENDOR_DRIVER_FILE))
    for name, package, folder in (*ROBOT_FILES, *environment):
        if package in folders and not (has_vendor_driver and name == "controller_file"):
            yield from _file_faults(name, Path(folders[package], folder), values.get(name, ""))
    configuration = Path(values.get(CONFIGURATION) or finder.get_path("modular_framework_api") + "/config")
    if not simulated and configuration.is_dir():
        used = VENDOR_DRIVER_FILE if has_vendor_driver else "connection_file"
        yield from _file_faults(used, configuration, values.get(used, ""))
    elif simulated and has_vendor_driver:
        value = values[VENDOR_DRIVER_FILE]
        yield (
            f"argument '{VENDOR_DRIVER_FILE}' is '{value}' with simulation:=true; only a real robot has a driver; "
            f"set simulation:=false, or omit {VENDOR_DRIVER_FILE}"
        )
    moveit = Path(folders.get("moveit_config_package", ""), "launch", "move_group.launch")
    if "moveit_config_package" in folders and not moveit.is_file():
        yield f"argument 'moveit_config_package' is '{values['moveit_config_package']}', which has no {moveit}"


def _file_faults(argument: str, folder: Path, name: str) -> Iterator[str]:
    """Yields the fault of a file in a folder that is missing or not valid XML."""
    path = Path(f"{folder}/{name}")
    if not path.is_file():
        file_names = sorted(entry.name for entry in folder.glob("*") if entry.is_file())
        allowed = listing(file_names, "the folder is empty")
        yield f"argument '{argument}' is '{name}', and {folder} has no such file; {allowed}{nearest(name, file_names)}"
    elif path.suffix in (".yaml", ".yml"):
        yield from (f"argument '{argument}' is '{name}': {fault}" for fault in _yaml_faults(path))
    elif path.suffix in (".world", ".xacro", ".urdf"):
        try:
            xml_text.read(path)
        except (xml_text.XmlError, OSError) as error:
            yield f"argument '{argument}' is '{name}': {error}"


def _method_faults(value: str) -> Iterator[str]:
    """Yields the faults of a method's launch file."""
    if value in NO_METHOD or Path(value).is_absolute() and Path(value).is_file():
        return
    allowed = "PACKAGE/FILE with a file in the package's folder launch, the path of a launch file from /, or none"
    fault, package, file = f"argument '{METHOD}' is '{value}', ", *value.partition("/")[::2]
    if Path(value).is_absolute() or not file:
        reason = f"and there is no such file{_path_hint(Path(value))}" if file else "which is not a launch file"
        yield f"{fault}{reason}; it must be {allowed}"
        return
    finder = rospkg.RosPack.get_instance()
    try:
        folder = Path(finder.get_path(package)) / "launch"
    except rospkg.ResourceNotFound:
        yield (
            f"{fault}and there is no package '{package}'; it must be {allowed}; correct it, or build and source the "
            f"workspace with the package{nearest(package, finder.list())}"
        )
        return
    if not (folder / file).is_file():
        files = sorted(f"{package}/{path.name}" for path in folder.glob("*.launch"))
        yield (
            f"{fault}and the package has no such file; "
            f"{listing(files, 'its folder launch is empty')}{nearest(value, files)}"
        )


def _folder_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields the faults of the configuration folder and of its files that roslaunch loads."""
    value = values.get(CONFIGURATION, "")
    folder = Path(value)
    if not value:
        return
    if not folder.is_absolute() or not folder.is_dir():
        yield (
            f"argument '{CONFIGURATION}' is '{value}'; it must be the path of a folder from /, such as a copy of the "
            f"folder config of modular_framework_api{_path_hint(folder)}"
        )
        return
    if "robot_package" not in values:
        return
    start = f"argument '{CONFIGURATION}' is '{value}'"
    for name in CONFIGURATION_FILES:
        try:
            located_yaml.load(folder / name, FaultList())
        except TaskFault as error:
            yield f"{start}: {error.faults[0]}"
    connection = (CONNECTION_FILE,) if values.get("simulation", "").lower() in ("false", "0") else ()
    octomap = (OCTOMAP_FILE,) if values.get("octomap", "").lower() in ("true", "1") else ()
    for name in (*connection, *octomap):
        if not (folder / name).is_file():
            yield f"{start}: {folder / name}: there is no such file; add it"
    for name in (*NAMES_FILES, *connection, *octomap):
        yield from (f"{start}: {fault}" for fault in _yaml_faults(folder / name))


def _yaml_faults(path: Path) -> Iterator[str]:
    """Yields the fault of a file that is not valid YAML; a missing file is no fault."""
    try:
        shallow_yaml.load(read_text(path))
    except FileNotFoundError:
        return
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        yield f"{path}:{line}: not valid YAML: {error.problem}"
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        yield f"{path}: {error}"


def _task_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields the fault of an unreadable task file. The content is checked at the start of the task."""
    value = values.get(SCRIPT, "")
    if not value or values.get(MACHINE, "").strip():
        return
    try:
        located_yaml.load(default_folders.task_script(Path(value)), FaultList())
    except TaskFault as error:
        yield f"argument '{SCRIPT}' is '{value}': {error.faults[0]}"


def _generated_name_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields the fault of an invalid name of the generated state machine."""
    name = values.get(GENERATED_NAME, "")
    fault = module_name_fault(name.removesuffix(".py")) if name and not values.get("state_machine_to_load") else ""
    if fault:
        yield f"argument '{GENERATED_NAME}' is '{name}', which {fault}"


def _path_hint(path: Path) -> str:
    """Returns a hint with the most similar path in the same folder, or ""."""
    siblings = [str(entry) for entry in path.parent.iterdir()] if path.is_absolute() and path.parent.is_dir() else []
    return nearest(str(path), siblings)
