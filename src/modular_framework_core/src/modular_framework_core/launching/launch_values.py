# SPDX-License-Identifier: BSD-3-Clause
"""Checks the values of the framework's launch arguments: packages, files and numbers.

roslaunch finds these faults too, node by node, and names neither the argument nor what is allowed.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import roslaunch.loader
import rospkg
import yaml

from modular_framework_core.files import default_folders, located_yaml, shallow_yaml
from modular_framework_core.files.atomic_files import read_text
from modular_framework_core.files.faults import FaultList, TaskFault, listing, nearest
from modular_framework_ros.parameter_declarations import node_declaration
from modular_framework_urdf import xml_text

METHOD, CONFIGURATION = "method_launch_file", "config_directory"
NO_METHOD = ("", "none")
"""Values of METHOD that start no method; roslaunch passes over an argument that is given an empty value."""
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
"""Files of the configuration folder without which nothing starts."""
NAMES_FILES = ("named_joint_states.yaml", "named_trajectories.yaml", "named_poses.yaml")
"""Files of the configuration folder that may be left out."""
SCRIPT, MACHINE = "task_constructor_script", "state_machine_to_load"
ROSLAUNCH_NOTE = "Nothing was started. The error of roslaunch that follows only says that this check failed."


def value_faults(values: Mapping[str, str]) -> list[str]:
    """Returns what is wrong with the values of launch arguments, one sentence each.

    Args:
        values: By name. The files of packages are looked up for launch files with the argument robot_package only.
    """
    return [
        *_truth_faults(values),
        *file_faults(values),
        *(_number_faults(values) if "robot_package" in values else ()),
    ]


def file_faults(values: Mapping[str, str]) -> list[str]:
    """Returns the packages and files that are not there or cannot be read; as `value_faults`."""
    faults = [*_method_faults(values.get(METHOD, "")), *_folder_faults(values), *_task_faults(values)]
    return [*faults, *(_package_faults(values) if "robot_package" in values else ())]


def main(arguments: list[str]) -> int:
    """Prints what is wrong with `NAME:=VALUE ...`; returns 1 if anything is, with which roslaunch gives up."""
    faults = value_faults(dict(argument.split(":=", 1) for argument in arguments))
    for fault in faults:
        print(fault, file=sys.stderr)
    if faults:
        print(ROSLAUNCH_NOTE, file=sys.stderr)
    return 1 if faults else 0


def _truth_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields what roslaunch cannot read as true or false."""
    value = values.get("simulation", "true")
    if value.lower() not in ("true", "false", "1", "0"):
        yield f"argument 'simulation' is '{value}', allowed are true and false; correct it"


def _number_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields numbers and choices that the simulation, or every node, does not take."""
    declared = node_declaration("modular_framework_simulation", "simulation")
    for name, item in (declared.parameters if declared else {}).items():
        argument = name.lstrip("~/")
        if (item.type in ("int", "float") or item.choices) and values.get(argument, "") != "":
            fault = item.fault(roslaunch.loader.convert_value(values[argument], "auto"))
            if fault:
                yield f"argument '{argument}' {fault}"


def _package_faults(values: Mapping[str, str]) -> Iterator[str]:
    finder = rospkg.RosPack()
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
    surroundings = (WORLD_FILE,) if simulated else (SCENE_FILE,) if values.get("scene_file") else ()
    for name, package, folder in (*ROBOT_FILES, *surroundings):
        if package in folders:
            yield from _file_faults(name, Path(folders[package], folder), values.get(name, ""))
    configuration = Path(values.get(CONFIGURATION) or finder.get_path("modular_framework_api") + "/config")
    if not simulated and configuration.is_dir():
        yield from _file_faults("connection_file", configuration, values.get("connection_file", ""))
    moveit = Path(folders.get("moveit_config_package", ""), "launch", "move_group.launch")
    if "moveit_config_package" in folders and not moveit.is_file():
        yield f"argument 'moveit_config_package' is '{values['moveit_config_package']}', which has no {moveit}"


def _file_faults(argument: str, folder: Path, name: str) -> Iterator[str]:
    """Yields why a file in a folder cannot be used: it is not there, or no XML."""
    path = Path(f"{folder}/{name}")
    if not path.is_file():
        there = sorted(entry.name for entry in folder.glob("*") if entry.is_file())
        allowed = listing(there, "the folder is empty")
        yield f"argument '{argument}' is '{name}', and {folder} has no such file; {allowed}{nearest(name, there)}"
    elif path.suffix in (".world", ".xacro", ".urdf"):
        try:
            xml_text.read(path)
        except (xml_text.XmlError, OSError) as error:
            yield f"argument '{argument}' is '{name}': {error}"


def _method_faults(value: str) -> Iterator[str]:
    """Yields what is wrong with the launch file of a method."""
    if value in NO_METHOD or Path(value).is_absolute() and Path(value).is_file():
        return
    allowed = "PACKAGE/FILE with a file in the package's folder launch, the path of a launch file from /, or none"
    fault, package, file = f"argument '{METHOD}' is '{value}', ", *value.partition("/")[::2]
    if Path(value).is_absolute() or not file:
        reason = f"and there is no such file{_path_hint(Path(value))}" if file else "which is no launch file"
        yield f"{fault}{reason}; allowed is {allowed}; correct it"
        return
    finder = rospkg.RosPack()
    try:
        folder = Path(finder.get_path(package)) / "launch"
    except rospkg.ResourceNotFound:
        yield (
            f"{fault}and there is no package '{package}'; allowed is {allowed}; correct it, or build and source the "
            f"workspace with the package{nearest(package, finder.list())}"
        )
        return
    if not (folder / file).is_file():
        files = sorted(f"{package}/{found.name}" for found in folder.glob("*.launch"))
        yield (
            f"{fault}and the package has no such file; "
            f"{listing(files, 'its folder launch is empty')}{nearest(value, files)}"
        )


def _folder_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields what is wrong with the folder of the configuration files, and with the files that roslaunch loads."""
    value = values.get(CONFIGURATION, "")
    folder = Path(value)
    if not value:
        return
    if not folder.is_absolute() or not folder.is_dir():
        yield (
            f"argument '{CONFIGURATION}' is '{value}', allowed is the path of a folder from /, such as a copy of the "
            f"folder config of modular_framework_api; correct it{_path_hint(folder)}"
        )
        return
    for name in CONFIGURATION_FILES if "robot_package" in values else ():
        try:
            located_yaml.load(folder / name, FaultList())
        except TaskFault as error:
            yield f"argument '{CONFIGURATION}' is '{value}': {error.faults[0]}"
    for name in NAMES_FILES if "robot_package" in values else ():
        try:
            shallow_yaml.load(read_text(folder / name))
        except FileNotFoundError:
            continue
        except yaml.MarkedYAMLError as error:
            line = error.problem_mark.line + 1 if error.problem_mark else 1
            yield f"argument '{CONFIGURATION}' is '{value}': {folder / name}:{line}: not valid YAML: {error.problem}"
        except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
            yield f"argument '{CONFIGURATION}' is '{value}': {folder / name}: {error}"


def _task_faults(values: Mapping[str, str]) -> Iterator[str]:
    """Yields why the file of the task cannot be read; what it says is checked when the task starts."""
    value = values.get(SCRIPT, "")
    if not value or values.get(MACHINE, "").strip():
        return
    try:
        located_yaml.load(default_folders.task_script(Path(value)), FaultList())
    except TaskFault as error:
        yield f"argument '{SCRIPT}' is '{value}': {error.faults[0]}"


def _path_hint(path: Path) -> str:
    """Returns a hint at the path beside a missing one whose name is most like it; empty when there is none."""
    beside = [str(entry) for entry in path.parent.iterdir()] if path.is_absolute() and path.parent.is_dir() else []
    return nearest(str(path), beside)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
